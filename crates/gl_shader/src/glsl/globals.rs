//! Variables at global scope: variables that the stage shares with the program and with other stages, samplers, and variables of its own.
//! Naga evaluates an initialiser only if it is constant. Other initialisers become assignments at the start of `main`, in order (OpenGL
//! Shading Language 1.20, section 4.3).

use std::collections::BTreeMap;

use super::blocks::Block;
use super::link::{Placed, is_own};
use super::lower::Lowering;
use super::prelude;
use super::rewrite::{Global, Storage};
use super::sampler::{Sampler, sampler};
use super::scope::{SamplerValue, Type, Variable};
use super::tokens::Dialect;
use super::tree::{Declaration, Declarator, Expr, ExprKind, Interface, Item, Kind, Qualifier, Statement, StatementKind};
use super::words::is_type;
use super::{TranslateResult, Wrong};
use crate::arb::program::ProgramStage;

/// Words of layouts that change nothing here, or that other code reads.
const HARMLESS: [&str; 9] =
    ["std140", "shared", "packed", "column_major", "row_major", "depth_any", "depth_greater", "depth_less", "depth_unchanged"];

/// Maximum number of samplers in an array.
const SAMPLERS_MAX: u64 = 64;

/// The qualifiers of a declaration.
#[derive(Clone, Copy, Default)]
struct Qualified {
    storage: Option<Storage>,
    interpolation: Option<&'static str>,
    location: Option<u32>,
    index: Option<u32>,
    binding: Option<u32>,
    row_major: bool,
    coordinates: [bool; 2],
}

impl Lowering {
    /// Lowers variables, structures and blocks.
    ///
    /// # Errors
    /// If a declaration is not supported.
    pub fn variables(&mut self, items: Vec<Placed<Item>>, dialects: &[Dialect]) -> TranslateResult {
        for Placed { at, of } in items {
            (self.at, self.dialect) = (at, dialects[at.0]);
            match of {
                Item::Declaration(of) => {
                    let qualified = self.qualified(&of.qualifiers)?;
                    match qualified.storage {
                        Some(storage) => self.shared(of, storage, qualified, None)?,
                        None => self.own(of)?,
                    }
                }
                Item::Interface(of) => self.interface(of)?,
                // It would change the blocks that follow.
                Item::Default(qualifiers) if self.qualified(&qualifiers)?.row_major => return row_major(qualifiers[0].line),
                Item::Default(_) | Item::Function(_) => {}
            }
        }
        Ok(())
    }

    fn qualified(&self, qualifiers: &[Qualifier]) -> TranslateResult<Qualified> {
        let mut all = Qualified::default();
        for of in qualifiers {
            match of.word.as_str() {
                "attribute" | "in" => all.storage = Some(Storage::In),
                "varying" if self.stage == ProgramStage::Vertex => all.storage = Some(Storage::Out),
                "varying" => all.storage = Some(Storage::In),
                "uniform" => all.storage = Some(Storage::Uniform),
                "out" => all.storage = Some(Storage::Out),
                "flat" => all.interpolation = Some("flat"),
                "noperspective" => all.interpolation = Some("linear"),
                _ => {}
            }
            for (name, value) in &of.layout {
                let number = || value.as_ref().and_then(Expr::as_number).and_then(|value| u32::try_from(value).ok());
                match (name.as_str(), value) {
                    ("location", Some(_)) => all.location = number(),
                    ("index", Some(_)) => all.index = number(),
                    ("binding", Some(_)) => all.binding = number(),
                    ("origin_upper_left", None) => all.coordinates[0] = true,
                    ("pixel_center_integer", None) => all.coordinates[1] = true,
                    ("row_major", None) => all.row_major = true,
                    (name, None) if HARMLESS.contains(&name) => {}
                    _ => return Err(Wrong::at(of.line, format!("layout({name}) of this form is not supported"))),
                }
            }
        }
        Ok(all)
    }

    /// Lowers variables that the stage shares. `block` is the name of the block that they are part of.
    fn shared(&mut self, mut of: Declaration, storage: Storage, qualified: Qualified, block: Option<&str>) -> TranslateResult {
        let line = of.qualifiers.first().map_or(of.kind.line, |first| first.line);
        let sampled = sampler(&of.kind.name);
        let known = |name: &str| name.starts_with("gl_") || self.scopes.find(name).is_some();
        if sampled.is_none() {
            let other = ["sampler", "image"].iter().any(|word| of.kind.name.contains(word)) && of.kind.members.is_none();
            if other && !of.names.iter().all(|name| known(&name.name)) {
                return Err(Wrong::at(line, format!("the type {} is not supported", of.kind.name)));
            }
            self.kind(&mut of.kind, false)?;
        }
        if of.kind.members.is_some() {
            let kind = Kind { sizes: Vec::new(), ..of.kind.clone() };
            self.out.declaration(&Declaration { qualifiers: Vec::new(), kind, names: Vec::new(), end: of.end });
            of.kind.members = None;
        }
        for mut name in of.names {
            if name.name == "gl_FragCoord" {
                let all = &mut self.source.coordinates;
                *all = [all[0] || qualified.coordinates[0], all[1] || qualified.coordinates[1]];
            }
            if name.name.starts_with("gl_") || self.scopes.find(&name.name).is_some() {
                continue;
            }
            if let Some(sampled) = sampled {
                self.sampler(&of.kind, &name, sampled, qualified.location, line)?;
                continue;
            }
            let source = block.map_or_else(|| name.name.clone(), |block| format!("{block}.{}", name.name));
            self.declarator(&mut name, &of.kind)?;
            let renamed = name.name.clone();
            if name.value.is_some() {
                self.source.initialised.insert(renamed.clone());
            }
            let Qualified { interpolation, location, index, .. } = qualified;
            let block = block.map(|_| self.source.blocks.len());
            self.source.globals.push(Global { name: source, renamed, storage, interpolation, location, index, block });
            self.out.declaration(&Declaration::plain(of.kind.clone(), name));
        }
        Ok(())
    }

    /// Notes a sampler or an array of samplers.
    fn sampler(
        &mut self,
        kind: &Kind,
        of: &Declarator,
        (target, dimensions, shadow): (usize, usize, bool),
        location: Option<u32>,
        line: u32,
    ) -> TranslateResult {
        let one = Sampler { name: of.name.clone(), target, dimensions, shadow, location };
        let first = self.source.samplers.len();
        let count = match &of.sizes.iter().chain(&kind.sizes).collect::<Vec<_>>()[..] {
            [] => None,
            [Some(size)] if size.as_number().is_some_and(|count| count <= SAMPLERS_MAX) => size.as_number(),
            _ => {
                let what = format!("the array {} of samplers, whose size is no number up to {SAMPLERS_MAX},", of.name);
                return Err(Wrong::at(line, format!("{what} is not supported")));
            }
        };
        match count {
            None => self.source.samplers.push(one),
            Some(count) => self.source.samplers.extend((0..count as u32).map(|k| Sampler {
                name: format!("{}[{k}]", of.name),
                location: location.and_then(|first| first.checked_add(k)),
                ..one.clone()
            })),
        }
        let value = SamplerValue { kind: kind.name.clone(), first, count: count.map(|count| count as usize) };
        let variable = Variable { kind: Type::plain(&kind.name), written: String::new(), sampler: Some(value) };
        self.scopes.declare(&of.name, variable);
        Ok(())
    }

    /// Lowers a uniform block. If its instance has a name, its members are members of a structure, or else they are variables.
    fn interface(&mut self, of: Interface) -> TranslateResult {
        let Interface { line, qualifiers, name: block, mut members, instance } = of;
        let qualified = self.qualified(&qualifiers)?;
        if qualified.storage != Some(Storage::Uniform) {
            return Err(Wrong::at(line, format!("the interface block {block} is not supported")));
        }
        if qualified.row_major {
            return row_major(line);
        }
        if instance.as_ref().is_some_and(|instance| !instance.sizes.is_empty()) {
            return Err(Wrong::at(line, format!("the array of the uniform block {block} is not supported")));
        }
        for member in &mut members {
            for (word, _) in member.qualifiers.iter().flat_map(|of| &of.layout) {
                match word.as_str() {
                    "row_major" => return row_major(member.kind.line),
                    "offset" | "align" => {
                        let what = "offset and align in a uniform block are not supported";
                        return Err(Wrong::at(member.kind.line, what));
                    }
                    _ => {}
                }
            }
            member.qualifiers.clear();
        }
        let variables = match instance {
            Some(instance) => {
                let name = format!("glx_block{}", self.source.blocks.len());
                vec![Declaration::plain(Kind { members: Some(members), ..Kind::plain(line, name) }, instance)]
            }
            None => members,
        };
        for of in variables {
            self.shared(of, Storage::Uniform, Qualified::default(), Some(&block))?;
        }
        self.source.blocks.push(Block { name: block, binding: qualified.binding });
        Ok(())
    }

    /// Lowers variables, constants and structures of the stage's own.
    fn own(&mut self, mut of: Declaration) -> TranslateResult {
        let mut moved = Vec::new();
        if is_own(&of) {
            let is_variable = |of: &Expr| match &of.kind {
                ExprKind::Name(name) => self.constants.get(name) == Some(&false),
                ExprKind::Call(name, ..) => prelude::renamed(name).is_some() && !self.functions.has(name),
                _ => false,
            };
            let is_const = of.has("const");
            let evaluated = is_const && !of.names.iter().filter_map(|name| name.value.as_ref()).any(|of| of.any(is_variable));
            if !evaluated {
                of.qualifiers.retain(|of| of.word != "const");
            }
            for name in &mut of.names {
                if is_const {
                    self.constants.insert(name.name.clone(), evaluated);
                }
                let Some(value) = name.value.take() else { continue };
                if evaluated || matches!(value.kind, ExprKind::List(_)) || is_constant(&value, &self.constants) {
                    self.source.initialised.insert(self.rename(&name.name));
                    name.value = Some(value);
                } else {
                    moved.push(Expr::assign(name.line, &name.name, value));
                }
            }
        }
        self.declaration(&mut of)?;
        self.out.declaration(&of);
        for mut of in moved {
            self.expr(&mut of)?;
            self.start.push(Statement::new(of.line, StatementKind::Expression(of)));
        }
        Ok(())
    }
}

fn row_major<T>(line: u32) -> TranslateResult<T> {
    Err(Wrong::at(line, "row_major in a uniform block is not supported"))
}

/// Returns true if naga evaluates this initialiser: numbers, constants, constructors and the arithmetic of scalars. Other initialisers may be
/// constant, too.
fn is_constant(value: &Expr, constants: &BTreeMap<String, bool>) -> bool {
    !value.any(|of| match &of.kind {
        ExprKind::Name(name) => !matches!(name.as_str(), "true" | "false") && constants.get(name) != Some(&true),
        ExprKind::Number(_) => false,
        ExprKind::Call(name, ..) => !is_type(name) || name.starts_with("mat"),
        ExprKind::Binary(operator, ..) => !matches!(*operator, "+" | "-" | "*" | "/"),
        ExprKind::Prefix(operator, _) => !matches!(*operator, "+" | "-"),
        _ => true,
    })
}
