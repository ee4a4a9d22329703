//! Random programs of several contexts, share groups, windows and threads against a model of what each of them keeps: pictures are equal to the
//! pixel. A context has colours, a scissor, bindings and frame buffer objects; a share group has textures of one texel; a window has pixels.

use std::collections::BTreeMap;

use fillrate::trace::Reading;

use super::gl_contexts::recorder::Value::{Enum, Null, Pointer, Uint};
use super::gl_contexts::{FRAMEBUFFER, Picture, Program, SCISSOR, TEXTURE_2D};

const EDGE: u32 = 8;
const WINDOWS: u64 = 3;
const NAMES: u64 = 3;

type Color = [u8; 3];

/// A window's pixels, with the lowest row first; none before its size is known.
type Pixels = Option<Vec<Color>>;

#[derive(Clone)]
struct Context {
    group: usize,
    color: Color,
    clear: Color,
    scissor: Option<[u32; 4]>,
    texture: u64,
    textured: bool,
    /// The bound frame buffer object; 0: the window.
    bound: u64,
    /// Their textures.
    objects: BTreeMap<u64, u64>,
    /// Whether it has been current.
    known: bool,
}

/// What is current in a thread: a context, the window that it draws to, and the one that it reads.
type Current = Option<(usize, usize, usize)>;

struct Model {
    random: u64,
    program: Program,
    contexts: Vec<Context>,
    /// The context of each handle.
    handles: [Option<usize>; 4],
    groups: Vec<BTreeMap<u64, Color>>,
    windows: [Pixels; WINDOWS as usize],
    threads: [Current; 2],
    /// The frames, and their windows.
    frames: Vec<(usize, Vec<Color>)>,
}

impl Model {
    fn new(seed: u64) -> Model {
        Model {
            random: seed * 2 + 1,
            program: Program::new(),
            contexts: Vec::new(),
            handles: [None; 4],
            groups: Vec::new(),
            windows: [const { None }; WINDOWS as usize],
            threads: [None; 2],
            frames: Vec::new(),
        }
    }

    fn below(&mut self, end: u64) -> u64 {
        self.random = self.random.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        (self.random >> 33) % end
    }

    fn some_color(&mut self) -> Color {
        std::array::from_fn(|_| if self.below(2) == 0 { 0 } else { 255 })
    }

    /// Makes a context, of a handle that may have had another one, or destroys it.
    fn make_or_destroy(&mut self) {
        let k = self.below(4) as usize;
        let handle = |k: usize| 0x100 + k as u64;
        if self.handles[k].take().is_some() {
            self.program.call("glXDestroyContext", &[Pointer(1), Pointer(handle(k))]);
            if self.below(3) == 0 {
                return;
            }
        }
        let share = Some(self.below(4) as usize).filter(|&share| self.handles[share].is_some());
        let group = match share {
            Some(share) => self.contexts[self.handles[share].expect("it has a context")].group,
            None => {
                self.groups.push(BTreeMap::new());
                self.groups.len() - 1
            }
        };
        self.program.make(handle(k), share.map_or(0, handle));
        self.handles[k] = Some(self.contexts.len());
        self.contexts.push(Context {
            group,
            color: [255; 3],
            clear: [0; 3],
            scissor: None,
            texture: 0,
            textured: false,
            bound: 0,
            objects: BTreeMap::new(),
            known: false,
        });
    }

    fn make_current(&mut self, thread: usize) {
        let (k, draw) = (self.below(4) as usize, self.below(WINDOWS) as usize);
        let read = if self.below(2) == 0 { draw } else { self.below(WINDOWS) as usize };
        let busy = |context| matches!(self.threads[1 - thread], Some((other, ..)) if other == context);
        let Some(context) = self.handles[k].filter(|&context| !busy(context)) else {
            self.program.current(0, 0);
            self.threads[thread] = None;
            return;
        };
        self.threads[thread] = Some((context, draw, read));
        let window = |k: usize| Uint(0x200 + k as u64);
        let args = [Pointer(1), window(draw), window(read), Pointer(0x100 + k as u64)];
        self.program.returning("glXMakeContextCurrent", &args, Uint(1));
        if !std::mem::replace(&mut self.contexts[context].known, true) {
            self.program.call("glViewport", &[0, 0, EDGE.into(), EDGE.into()].map(Uint));
            self.open(draw);
        }
    }

    /// A window starts black.
    fn open(&mut self, window: usize) {
        self.windows[window].get_or_insert_with(|| vec![[0; 3]; (EDGE * EDGE) as usize]);
    }

    /// Sets the pixels of a window or of a texture that the scissor lets pass.
    fn fill(&mut self, (context, draw, _): (usize, usize, usize), color: impl Fn(usize) -> Color) {
        let Context { scissor, bound, group, .. } = self.contexts[context].clone();
        let [x, y, width, height] = scissor.unwrap_or([0, 0, EDGE, EDGE]);
        let passes = |k: u32| (x..x + width).contains(&(k % EDGE)) && (y..y + height).contains(&(k / EDGE));
        if bound != 0 {
            // Without an attached texture it is not complete.
            if let Some(&texture) = self.contexts[context].objects.get(&bound).filter(|_| passes(0)) {
                self.groups[group].insert(texture, color(0));
            }
            return;
        }
        self.open(draw);
        for (k, pixel) in self.windows[draw].iter_mut().flatten().enumerate() {
            *pixel = if passes(k as u32) { color(k) } else { *pixel };
        }
    }

    fn draw(&mut self, now: (usize, usize, usize)) {
        let Context { group, texture, textured, bound, color, ref objects, .. } = self.contexts[now.0];
        let read = self.groups[group].get(&texture).copied().filter(|_| textured && texture != 0);
        // What is drawn into must not be read.
        if bound != 0 && read.is_some() && objects.get(&bound) == Some(&texture) {
            return;
        }
        self.program.quad();
        let read = read.unwrap_or([255; 3]);
        self.fill(now, |_| std::array::from_fn(|c| color[c] & read[c]));
    }

    fn step(&mut self) {
        let thread = self.below(2) as usize;
        self.program.thread(thread as u64);
        match self.below(8) {
            0 => return self.make_or_destroy(),
            1 | 2 => return self.make_current(thread),
            3 => {
                let window = self.below(WINDOWS) as usize;
                self.program.swap(0x200 + window as u64);
                let pixels = self.windows[window].clone();
                self.frames.extend(pixels.map(|pixels| (window, pixels)));
                return;
            }
            _ => {}
        }
        let (what, name, value) = (self.below(10), 1 + self.below(NAMES), self.some_color());
        let Some(now @ (current, draw, read)) = self.threads[thread] else {
            // Without a context it does nothing.
            self.program.color(value).clear(value);
            return;
        };
        let group = self.contexts[current].group;
        let context = &mut self.contexts[current];
        match what {
            0 => {
                self.program.color(value);
                context.color = value;
            }
            1 | 2 => {
                self.program.clear(value);
                context.clear = value;
                self.fill(now, |_| value);
            }
            3 | 4 => {
                self.program.bind(name);
                context.texture = name;
                if value[2] != 0 {
                    self.program.texel(value);
                    self.groups[group].insert(name, value);
                }
            }
            5 => {
                context.textured = value[0] != 0 || value[1] != 0;
                self.program.call(if context.textured { "glEnable" } else { "glDisable" }, &[Enum(TEXTURE_2D)]);
            }
            6 if self.groups[group].contains_key(&name) => {
                context.bound = 1 + u64::from(value[0] != 0);
                context.objects.insert(context.bound, name);
                self.program.target(context.bound, name);
            }
            7 => {
                context.bound = if value[1] != 0 { 0 } else { 1 + u64::from(value[0] != 0) };
                self.program.call("glBindFramebuffer", &[Enum(FRAMEBUFFER), Uint(context.bound)]);
            }
            8 => {
                let [x, y] = [name as u32 - 1, u32::from(value[0] & 3)];
                let area = [x, y, 3, 4];
                context.scissor = (value[1] != 0).then_some(area);
                self.program.call("glScissor", &area.map(|edge| Uint(edge.into())));
                self.program.call(if value[1] != 0 { "glEnable" } else { "glDisable" }, &[Enum(SCISSOR)]);
            }
            9 if context.bound == 0 && draw != read && self.windows[read].is_some() => {
                let edge = u64::from(EDGE);
                let area = [0, 0, edge, edge, 0, 0, edge, edge, 0x4000].map(Uint);
                self.program.call("glBlitFramebuffer", &[area.as_slice(), &[Enum(0x2600)]].concat());
                let pixels = self.windows[read].clone().expect("it has a size");
                self.fill(now, |k| pixels[k]);
            }
            _ => self.draw(now),
        }
    }

    /// The pixels of a picture, with the lowest row first.
    fn pixels(picture: &Picture) -> Vec<Color> {
        assert_eq!(picture.size, [EDGE; 2]);
        picture.pixels.chunks(EDGE as usize).rev().flatten().copied().collect()
    }
}

#[test]
fn random_programs_of_several_contexts_look_as_their_model() {
    let mut frames = 0;
    for seed in 0..40 {
        let mut model = Model::new(seed);
        model.make_or_destroy();
        for _ in 0..120 {
            model.step();
        }
        // The first swap would else be the only call.
        model.program.thread(0).returning("glXMakeCurrent", &[Pointer(1), Uint(0), Null], Uint(1));
        let (pictures, _) = model.program.shown_with(&Reading::default(), 0..u64::MAX);
        let shown: Vec<Vec<Color>> = pictures.iter().map(Model::pixels).collect();
        assert_eq!(shown.len(), model.frames.len(), "program {seed}");
        for (k, (shown, (window, wanted))) in shown.iter().zip(&model.frames).enumerate() {
            let calls = || model.program.calls.join("\n");
            assert!(shown == wanted, "program {seed}, frame {k} of window {window}:\n{shown:?}\n{wanted:?}\n{}", calls());
        }
        frames += shown.len();
        // Frames that are not wanted are left out as far as no later one can show it.
        if let Some(last) = shown.len().checked_sub(1) {
            let (part, _) = model.program.shown_with(&Reading::default(), last as u64..last as u64 + 1);
            assert_eq!(part.last().map(Model::pixels), shown.last().cloned(), "program {seed}, the last frame alone");
        }
    }
    assert!(frames > 200, "{frames} frames");
}
