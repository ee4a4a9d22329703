//! Rooms that are drawn when a walk through their doors meets them.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Compare;
use glam::{DVec3, Vec3, dvec3};
use num::Random;
use trace::Trace;

pub(super) const PORTAL: Scene = Scene {
    name: "portal",
    group: "Culling",
    what: "25 rooms joined by doors. From the eye's room on a walk in f32 goes through each door whose rectangle on the screen, cut to that of the doors before it, is not \
           empty: it leaves out the rooms to which f64 finds no way of doors with a common rectangle, draws all that are seen through doors clipped as polygons, and the \
           picture is that of all drawn.",
    fault: "doors are taken to be at most 0.3 high",
    play: portal,
};

const SIZE: [u32; 2] = [256, 128];
/// Rooms each way, and how long they are.
const ROOMS: usize = 5;
const EDGE: f32 = 4.0;
const HEIGHT: f32 = 3.0;
const EYE: [f32; 3] = [9.1, 1.4, 0.7];
const NEAR: f32 = 0.1;

/// A wall between two rooms, with the opening of a door in it.
struct Wall {
    /// Rooms on its two sides, if there are any.
    rooms: [Option<usize>; 2],
    /// Its ends on the floor, x and z.
    ends: [[f32; 2]; 2],
    /// From where to where along the wall there is a door.
    door: Option<[f32; 2]>,
}

const LINTEL: f32 = 2.2;

fn walls() -> Vec<Wall> {
    let mut random = Random::new(21);
    let mut walls = Vec::new();
    for line in 0..=ROOMS {
        for cell in 0..ROOMS {
            for across in [false, true] {
                let room = |l: usize| if across { l * ROOMS + cell } else { cell * ROOMS + l };
                let rooms = [(line > 0).then(|| room(line - 1)), (line < ROOMS).then(|| room(line))];
                let [at, from] = [line, cell].map(|k| k as f32 * EDGE);
                let place = |along: f32| if across { [along, at] } else { [at, along] };
                let left = random.range(0.4, 2.2);
                let inner = rooms.iter().all(Option::is_some) && random.below(4) > 0;
                walls.push(Wall {
                    rooms,
                    ends: [place(from), place(from + EDGE)],
                    door: inner.then_some([left / EDGE, (left + 1.2) / EDGE]),
                });
            }
        }
    }
    walls
}

impl Wall {
    /// Corners of the part between two places along the wall and two heights.
    fn part(&self, [from, to]: [f32; 2], [low, high]: [f32; 2]) -> [[f32; 3]; 4] {
        let at = |t: f32, y: f32| {
            let [x, z] = std::array::from_fn(|c| self.ends[0][c] + t * (self.ends[1][c] - self.ends[0][c]));
            [x, y, z]
        };
        [at(from, low), at(to, low), at(to, high), at(from, high)]
    }
}

/// x, y and depth as the eye sees them, looking along z: x and y in units of half the screen's height.
fn seen(p: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|c| p[c] - EYE[c])
}

/// A screen's rectangle: left, bottom, right, top, where x goes from -2 to 2 and y from -1 to 1.
type Window = [f32; 4];

/// The rooms that a walk through doors meets, as a program does it: rectangles in f32.
fn walk(walls: &[Wall], room: usize, window: Window, from: &mut Vec<usize>, met: &mut [bool], lintel: f32) -> u32 {
    met[room] = true;
    from.push(room);
    let mut tests = 0;
    for wall in walls.iter().filter(|wall| wall.rooms.contains(&Some(room))) {
        let (Some(door), [Some(a), Some(b)]) = (wall.door, wall.rooms) else { continue };
        let next = if a == room { b } else { a };
        if from.contains(&next) {
            continue;
        }
        tests += 1;
        let corners = wall.part(door, [0.0, lintel]).map(seen);
        let cut = if corners.iter().all(|c| c[2] < NEAR) {
            continue;
        } else if corners.iter().any(|c| c[2] < NEAR) {
            window
        } else {
            let all = |c: usize| corners.map(|p| p[c] / p[2]);
            let [x, y] = [all(0), all(1)];
            let low = |v: [f32; 4]| v.iter().copied().fold(f32::MAX, f32::min);
            let high = |v: [f32; 4]| v.iter().copied().fold(f32::MIN, f32::max);
            [window[0].max(low(x)), window[1].max(low(y)), window[2].min(high(x)), window[3].min(high(y))]
        };
        if cut[0] < cut[2] && cut[1] < cut[3] {
            tests += walk(walls, next, cut, from, met, lintel);
        }
    }
    from.pop();
    tests
}

/// The same in f64: the rectangle that all doors of each way from room to room have in common, found anew for each way.
fn ways(walls: &[Wall], way: &mut Vec<usize>, windows: &mut Vec<[f64; 4]>, met: &mut [bool]) {
    let room = way[way.len() - 1];
    met[room] = true;
    for wall in walls.iter().filter(|wall| wall.rooms.contains(&Some(room))) {
        let (Some(door), [Some(a), Some(b)]) = (wall.door, wall.rooms) else { continue };
        let next = if a == room { b } else { a };
        let corners: Vec<[f64; 3]> = wall
            .part(door, [0.0, LINTEL])
            .iter()
            .map(|&p| std::array::from_fn(|c| f64::from(p[c]) - f64::from(EYE[c])))
            .collect();
        let near = corners.iter().filter(|c| c[2] < f64::from(NEAR)).count();
        if way.contains(&next) || near == corners.len() {
            continue;
        }
        let bound = |c: usize, best: fn(f64, f64) -> f64| corners.iter().map(|p| p[c] / p[2]).reduce(best).unwrap_or(0.0);
        let everything = [-2.0, -1.0, 2.0, 1.0];
        let own = [bound(0, f64::min), bound(1, f64::min), bound(0, f64::max), bound(1, f64::max)];
        windows.push(if near > 0 { everything } else { own });
        let low = |c: usize| windows.iter().map(|w| w[c]).fold(everything[c], f64::max);
        let high = |c: usize| windows.iter().map(|w| w[c]).fold(everything[c], f64::min);
        if low(0) < high(2) && low(1) < high(3) {
            way.push(next);
            ways(walls, way, windows, met);
            way.pop();
        }
        windows.pop();
    }
}

/// What is seen through doors: a door is a polygon that the pyramid of planes through the eye clips, one plane after another.
fn through(walls: &[Wall], room: usize, planes: &[DVec3], from: &mut Vec<usize>, met: &mut [bool]) {
    met[room] = true;
    from.push(room);
    for wall in walls.iter().filter(|wall| wall.rooms.contains(&Some(room))) {
        let (Some(door), [Some(a), Some(b)]) = (wall.door, wall.rooms) else { continue };
        let next = if a == room { b } else { a };
        if from.contains(&next) {
            continue;
        }
        let eye = Vec3::from(EYE).as_dvec3();
        let door: Vec<DVec3> = wall.part(door, [0.0, LINTEL]).iter().map(|&p| Vec3::from(p).as_dvec3() - eye).collect();
        let clipped = planes.iter().fold(door.clone(), |polygon, plane| {
            let mut left = Vec::new();
            for (k, &p) in polygon.iter().enumerate() {
                let q = polygon[(k + 1) % polygon.len()];
                let [at, to] = [plane.dot(p), plane.dot(q)];
                if at > 0.0 {
                    left.push(p);
                }
                if (at > 0.0) != (to > 0.0) {
                    left.push(p + at / (at - to) * (q - p));
                }
            }
            left
        });
        // What is in front of the near plane is not seen through; what crosses it does not narrow the view.
        if clipped.iter().all(|p| p.z < f64::from(NEAR)) {
            continue;
        }
        let mut narrowed = planes.to_vec();
        if door.iter().all(|p| p.z >= f64::from(NEAR)) {
            let slope = |c: usize| door.iter().map(move |p| p[c] / p.z);
            for (c, axis) in [DVec3::X, DVec3::Y].into_iter().enumerate() {
                let (low, high) = (slope(c).fold(f64::MAX, f64::min), slope(c).fold(f64::MIN, f64::max));
                narrowed.extend([axis.with_z(-low), (-axis).with_z(high)]);
            }
        }
        through(walls, next, &narrowed, from, met);
    }
    from.pop();
}

fn drawn(walls: &[Wall], met: &[bool]) -> Trace {
    let mut random = Random::new(4);
    let mut out: Vec<f32> = Vec::new();
    let mut quad = |corners: [[f32; 3]; 4], color: [f32; 3]| {
        for k in [0, 1, 2, 0, 2, 3] {
            let [x, y, z] = seen(corners[k]);
            out.extend([x / 2.0, y, z - NEAR, z, color[0], color[1], color[2], 1.0]);
        }
    };
    for (room, &met) in met.iter().enumerate() {
        let [x, z] = [room % ROOMS, room / ROOMS].map(|k| k as f32 * EDGE);
        let tint = [0.3 + 0.15 * (room % 5) as f32, 0.3 + 0.1 * (room / 5) as f32, 0.5];
        let things: Vec<_> = (0..8)
            .map(|_| {
                let [a, b, c] = [x, 0.0, z].map(|from| from + random.range(0.3, 2.6));
                let [w, h] = [random.range(0.2, 0.9), random.range(0.2, 0.4)];
                let corners = [[a, b, c], [a + w, b, c + h], [a + w, b + h, c + h], [a, b + h, c]];
                (corners, std::array::from_fn(|_| random.range(0.2, 1.0)))
            })
            .collect();
        if met {
            let level = |y: f32| [[x, y, z], [x + EDGE, y, z], [x + EDGE, y, z + EDGE], [x, y, z + EDGE]];
            quad(level(0.0), tint.map(|c| 0.6 * c));
            quad(level(HEIGHT), tint.map(|c| 0.3 + 0.5 * c));
            things.into_iter().for_each(|(corners, color)| quad(corners, color));
        }
    }
    for (number, wall) in walls.iter().enumerate() {
        if wall.rooms.iter().flatten().any(|&room| met[room]) {
            let shade = 0.35 + 0.1 * (number % 5) as f32;
            let color = [shade, shade * 0.9, shade * 0.7];
            match wall.door {
                None => quad(wall.part([0.0, 1.0], [0.0, HEIGHT]), color),
                Some([from, to]) => {
                    quad(wall.part([0.0, from], [0.0, HEIGHT]), color);
                    quad(wall.part([to, 1.0], [0.0, HEIGHT]), color);
                    quad(wall.part([from, to], [LINTEL, HEIGHT]), color);
                }
            }
        }
    }
    let mut kit = Kit::new("portal");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let draw = Draw::list(COLORED, 2, out).depth(Format::Depth32Float, Compare::Less);
    let pass =
        Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
    kit.pass(&pass, &[draw]);
    kit.present(target);
    kit.finish()
}

fn portal(stage: &mut SceneRun) -> Result<()> {
    let walls = walls();
    let own = (EYE[2] / EDGE) as usize * ROOMS + (EYE[0] / EDGE) as usize;
    let (mut met, mut right) = ([false; ROOMS * ROOMS], [false; ROOMS * ROOMS]);
    let lintel = if stage.fault() { 0.3 } else { LINTEL };
    let tests = walk(&walls, own, [-2.0, -1.0, 2.0, 1.0], &mut Vec::new(), &mut met, lintel);
    let view = [dvec3(1.0, 0.0, 2.0), dvec3(-1.0, 0.0, 2.0), dvec3(0.0, 1.0, 1.0), dvec3(0.0, -1.0, 1.0)];
    ways(&walls, &mut vec![own], &mut Vec::new(), &mut right);
    let mut seen = [false; ROOMS * ROOMS];
    through(&walls, own, &view, &mut Vec::new(), &mut seen);
    let (culled, whole) = (drawn(&walls, &met), drawn(&walls, &[true; ROOMS * ROOMS]));
    let frames = stage.show(&culled)?;
    let other = stage.frames(&whole)?;
    stage.row(Row::none(
        "rooms about which f64 decides otherwise",
        met.iter().zip(&right).filter(|(a, b)| a != b).count() as u64,
    ));
    let hidden = met.iter().zip(&seen).filter(|(met, seen)| **seen && !**met).count();
    stage.row(Row::none("rooms seen through polygons of doors that are not drawn", hidden as u64));
    stage.row(Row::none("pixels that differ from the picture of all drawn", frames[0].differing(&other[0])));
    let left = met.iter().filter(|&&met| met).count();
    stage.row(Row::at_least("rooms left out", 10.0, (met.len() - left) as f64));
    stage.row(Row::at_least("rooms drawn", 5.0, left as f64));
    if !stage.fault() {
        let (few, many) = (stage.time(&culled, &[])?.0, stage.time(&whole, &[])?.0);
        stage.row(Row::at_least("cycles that culling saves", 1.0, many - few));
        let answer = format!(
            "{tests} tests of doors leave {left} of {} rooms: {few} cycles, and {many} for all. Doors clipped as \
             polygons would leave {}.",
            met.len(),
            seen.iter().filter(|&&seen| seen).count()
        );
        stage.answer("When do portals pay?", answer);
    }
    Ok(())
}
