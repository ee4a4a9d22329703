//! The lighting equation (OpenGL 1.5, section 2.14.1).

use anyhow::Result;
use glam::{DVec3, DVec4, dvec3};

use super::super::{Row, Setting};
use super::{Cases, list, point, unit, vector};
use num::Random;

/// A light, in eye space.
struct Light {
    ambient: [f64; 3],
    diffuse: [f64; 3],
    specular: [f64; 3],
    position: DVec4,
    attenuation: [f64; 3],
    /// Direction, cutoff in degrees, exponent.
    spot: Option<(DVec3, f64, f64)>,
}

/// A vertex and all that lights it.
struct Scene {
    emission: [f64; 3],
    ambient: [f64; 3],
    diffuse: [f64; 3],
    specular: [f64; 3],
    shininess: f64,
    model: [f64; 3],
    lights: Vec<Light>,
    local: bool,
    normal: DVec3,
    at: DVec3,
}

impl Scene {
    /// A scene of materials alone.
    fn dark(random: &mut Random) -> Scene {
        let mut color = |most: f64| std::array::from_fn(|_| most * unit(random));
        Scene {
            emission: color(0.2),
            ambient: color(1.0),
            diffuse: [0.0; 3],
            specular: [0.0; 3],
            shininess: 0.0,
            model: color(0.6),
            lights: Vec::new(),
            local: false,
            normal: dvec3(unit(random) - 0.5, unit(random) - 0.5, 0.3 + unit(random)).normalize(),
            at: vector(|| 1.6 * unit(random) - 0.8),
        }
    }

    fn light(&mut self, random: &mut Random, directional: bool) {
        let side = |random: &mut Random| 2.0 * unit(random) - 1.0;
        let position = dvec3(side(random), side(random), 1.0 + unit(random)).extend(if directional { 0.0 } else { 1.0 });
        let (ambient, diffuse, specular) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        self.lights.push(Light { ambient, diffuse, specular, position, attenuation: [1.0, 0.0, 0.0], spot: None });
    }

    /// The colour of the equation.
    fn color(&self) -> [f64; 3] {
        let mut sum: [f64; 3] = std::array::from_fn(|c| self.emission[c] + self.model[c] * self.ambient[c]);
        for light in &self.lights {
            let (from, w) = (light.position.truncate(), light.position.w);
            let way = if w == 0.0 { from } else { from / w - self.at };
            let (distance, to) = (way.length(), way.normalize());
            let [a, b, c] = light.attenuation;
            let mut strength = if w == 0.0 { 1.0 } else { 1.0 / (a + b * distance + c * distance * distance) };
            if let Some((direction, cutoff, exponent)) = light.spot {
                let inside = -to.dot(direction.normalize());
                strength *= if inside >= cutoff.to_radians().cos() { inside.max(0.0).powf(exponent) } else { 0.0 };
            }
            let facing = self.normal.dot(to).max(0.0);
            let eye = if self.local { -self.at.normalize() } else { DVec3::Z };
            let half = (to + eye).normalize();
            let gloss = if facing > 0.0 { self.normal.dot(half).max(0.0).powf(self.shininess) } else { 0.0 };
            for c in 0..3 {
                sum[c] += strength
                    * (light.ambient[c] * self.ambient[c]
                        + facing * light.diffuse[c] * self.diffuse[c]
                        + gloss * light.specular[c] * self.specular[c]);
            }
        }
        sum
    }

    /// The calls, without what is drawn. `scale` is the length of the normal.
    fn calls(&self, face: &str, scale: f64, fault: bool) -> String {
        let mut text = format!(
            "glEnable(GL_LIGHTING)\nglMaterialfv({face},GL_EMISSION,{{{},1}})\nglMaterialfv({face},GL_AMBIENT,{{{},1}})\n\
             glMaterialfv({face},GL_DIFFUSE,{{{},1}})\nglMaterialfv({face},GL_SPECULAR,{{{},1}})\nglMaterialf({face},GL_SHININESS,{})\n\
             glLightModelfv(GL_LIGHT_MODEL_AMBIENT,{{{},1}})\nglLightModeli(GL_LIGHT_MODEL_LOCAL_VIEWER,{})\n",
            list(&self.emission.map(|v| if fault { 0.5 * v } else { v })),
            list(&self.ambient),
            list(&self.diffuse),
            list(&self.specular),
            self.shininess,
            list(&self.model),
            u8::from(self.local)
        );
        for (k, light) in self.lights.iter().enumerate() {
            let [a, b, c] = light.attenuation;
            text += &format!(
                "glEnable(GL_LIGHT{k})\nglLightfv(GL_LIGHT{k},GL_AMBIENT,{{{},1}})\nglLightfv(GL_LIGHT{k},GL_DIFFUSE,{{{},1}})\n\
                 glLightfv(GL_LIGHT{k},GL_SPECULAR,{{{},1}})\nglLightfv(GL_LIGHT{k},GL_POSITION,{{{}}})\n\
                 glLightf(GL_LIGHT{k},GL_CONSTANT_ATTENUATION,{a})\nglLightf(GL_LIGHT{k},GL_LINEAR_ATTENUATION,{b})\n\
                 glLightf(GL_LIGHT{k},GL_QUADRATIC_ATTENUATION,{c})\n",
                list(&light.ambient.map(|v| if fault { 0.5 * v } else { v })),
                list(&light.diffuse),
                list(&light.specular),
                list(&light.position.to_array())
            );
            if let Some((direction, cutoff, exponent)) = light.spot {
                text += &format!(
                    "glLightfv(GL_LIGHT{k},GL_SPOT_DIRECTION,{{{}}})\nglLightf(GL_LIGHT{k},GL_SPOT_CUTOFF,{cutoff})\n\
                     glLightf(GL_LIGHT{k},GL_SPOT_EXPONENT,{exponent})\n",
                    list(&direction.to_array())
                );
            }
        }
        let [x, y, z] = (self.normal * scale).to_array();
        text += &format!("glNormal3f({})\n", list(&if fault { [x, z, y] } else { [x, y, z] }));
        text
    }
}

/// What a scene shows.
#[derive(Clone, Copy, PartialEq)]
enum Term {
    None,
    Ambient,
    Diffuse,
    Specular,
}

pub(super) fn check(setting: &Setting) -> Result<Vec<Row>> {
    let mut random = Random::nth(setting.seed, 0x11);
    let mut cases = Cases::default();
    let fault = setting.inject_fault;
    for _ in 0..setting.pick(3, 12, 60) {
        let random = &mut random;
        let mut make = |term: Term, directional: bool, change: &dyn Fn(&mut Scene, &mut Random)| {
            let mut scene = Scene::dark(random);
            if term != Term::None {
                scene.light(random, directional);
                let color: [f64; 3] = std::array::from_fn(|_| unit(random));
                let light = &mut scene.lights[0];
                match term {
                    Term::Ambient => light.ambient = color,
                    Term::Diffuse => (light.diffuse, scene.diffuse) = (color, [0.9, 0.7, 0.8]),
                    _ => {
                        (light.specular, scene.specular) = (color, [0.8, 0.9, 0.7]);
                        scene.shininess = (64.0 * unit(random)).floor();
                    }
                }
            }
            change(&mut scene, random);
            scene
        };
        let near = |scene: &mut Scene, random: &mut Random| {
            scene.lights[0].attenuation = [0.2 + unit(random), 0.5 * unit(random), 0.25 * unit(random)];
        };
        let spot = |scene: &mut Scene, random: &mut Random| {
            let light = &mut scene.lights[0];
            let target = scene.at - light.position.truncate() + vector(|| 0.6 * (unit(random) - 0.5));
            light.spot = Some((target.as_vec3().as_dvec3(), 20.0 + 50.0 * unit(random), (8.0 * unit(random)).floor()));
        };
        let local = |scene: &mut Scene, _: &mut Random| scene.local = true;
        let same = |_: &mut Scene, _: &mut Random| {};
        let plain: [(&str, Scene); 11] = [
            ("emission and ambient light of the scene", make(Term::None, true, &same)),
            ("ambient, directional", make(Term::Ambient, true, &same)),
            ("ambient, attenuated", make(Term::Ambient, false, &near)),
            ("diffuse, directional", make(Term::Diffuse, true, &same)),
            ("diffuse, positional", make(Term::Diffuse, false, &same)),
            ("diffuse, attenuated", make(Term::Diffuse, false, &near)),
            ("diffuse, spot", make(Term::Diffuse, false, &spot)),
            ("specular, directional", make(Term::Specular, true, &same)),
            ("specular, positional", make(Term::Specular, false, &same)),
            ("specular, local viewer, directional", make(Term::Specular, true, &local)),
            ("specular, local viewer, positional", make(Term::Specular, false, &local)),
        ];
        for (name, scene) in &plain {
            cases.frame(*name, &format!("{}{}", scene.calls("GL_FRONT", 1.0, fault), point(scene.at)), scene.color());
        }
        let scene = make(Term::Specular, false, &|scene, _| (scene.lights[0].diffuse, scene.diffuse) = ([0.5; 3], [0.8; 3]));
        let calls = format!(
            "glLightModeli(GL_LIGHT_MODEL_COLOR_CONTROL,GL_SEPARATE_SPECULAR_COLOR)\n{}",
            scene.calls("GL_FRONT", 1.0, fault)
        );
        cases.frame("specular, separate", &format!("{calls}{}", point(scene.at)), scene.color());
        let scene = make(Term::Diffuse, true, &same);
        let calls = format!("glEnable(GL_NORMALIZE)\n{}", scene.calls("GL_FRONT", 3.0, fault));
        cases.frame("normals normalised", &format!("{calls}{}", point(scene.at)), scene.color());
        // The modelview matrix makes normals half as long.
        let matrix = "glMatrixMode(GL_MODELVIEW)\nglPushMatrix()\nglScalef(2,2,2)\n";
        let calls = format!("glEnable(GL_RESCALE_NORMAL)\n{}{matrix}", scene.calls("GL_FRONT", 1.0, fault));
        cases.frame("normals rescaled", &format!("{calls}{}\nglPopMatrix()", point(0.1 * DVec3::X)), scene.color());
        // Back faces have the opposite normal, so the light is turned round.
        let mut back = make(Term::Diffuse, true, &same);
        back.lights[0].position *= -1.0;
        let mut calls = back.calls("GL_BACK", 1.0, fault);
        calls += "glLightModeli(GL_LIGHT_MODEL_TWO_SIDE,1)\nglBegin(GL_TRIANGLES)\n";
        calls += "glVertex2f(-1,-1)\nglVertex2f(-1,3)\nglVertex2f(3,-1)\nglEnd()";
        back.normal *= -1.0;
        cases.frame("back faces", &calls, back.color());
        tracked(&mut cases, &make(Term::Diffuse, true, &same), &make(Term::Specular, false, &same), random, fault);
    }
    cases.rows()
}

/// Colour material: the current colour takes the place of a material's.
fn tracked(cases: &mut Cases, diffuse: &Scene, specular: &Scene, random: &mut Random, fault: bool) {
    let color: [f64; 3] = std::array::from_fn(|_| unit(random));
    for mode in ["AMBIENT", "DIFFUSE", "AMBIENT_AND_DIFFUSE", "SPECULAR", "EMISSION"] {
        let scene = if mode == "SPECULAR" { specular } else { diffuse };
        let calls = format!(
            "{}glColorMaterial(GL_FRONT_AND_BACK,GL_{mode})\nglEnable(GL_COLOR_MATERIAL)\nglColor3f({})\n{}",
            scene.calls("GL_FRONT", 1.0, fault),
            list(&color),
            point(scene.at)
        );
        let lights = scene.lights.iter().map(|l| Light { spot: l.spot, ..*l }).collect();
        let mut with = Scene { lights, ..*scene };
        match mode {
            "AMBIENT" => with.ambient = color,
            "DIFFUSE" => with.diffuse = color,
            "AMBIENT_AND_DIFFUSE" => (with.ambient, with.diffuse) = (color, color),
            "SPECULAR" => with.specular = color,
            _ => with.emission = color,
        }
        cases.frame(format!("colour material, {}", mode.to_lowercase().replace('_', " ")), &calls, with.color());
    }
}
