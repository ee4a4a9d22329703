//! The layout of uniforms: each scalar, vector and matrix column has its own vec4 in one array.

use std::collections::BTreeMap;

use naga::{ArraySize, Handle, Module, ScalarKind, Type, TypeInner};

/// Maximum number of elements of a value that is read as a whole.
const WHOLE_MAX: usize = 256;

/// The type of a uniform.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Layout {
    /// A scalar or vector: components and their kind.
    Vector(usize, ScalarKind),
    /// A matrix: columns and rows.
    Matrix(usize, usize),
    /// An array: elements and their number.
    Array(Box<Layout>, usize),
    /// A structure: its name in WGSL and its members.
    Struct(String, Vec<Member>),
}

/// A member of a structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name.
    pub name: String,
    /// Its name in WGSL.
    pub wgsl: String,
    /// Its type.
    pub layout: Layout,
}

/// Names of structures in WGSL, and those of their members.
pub type Structures = BTreeMap<Handle<Type>, (String, Vec<String>)>;

impl Layout {
    /// The layout of a type.
    pub fn of(module: &Module, kind: Handle<Type>, structures: &Structures) -> Result<Layout, String> {
        let wide = |scalar: naga::Scalar| scalar.kind == ScalarKind::Bool || scalar.width == 4;
        match &module.types[kind].inner {
            TypeInner::Scalar(scalar) if wide(*scalar) => Ok(Layout::Vector(1, scalar.kind)),
            TypeInner::Vector { size, scalar } if wide(*scalar) => Ok(Layout::Vector(*size as usize, scalar.kind)),
            TypeInner::Matrix { columns, rows, scalar } if wide(*scalar) => {
                Ok(Layout::Matrix(*columns as usize, *rows as usize))
            }
            TypeInner::Array { base, size: ArraySize::Constant(count), .. } => {
                Ok(Layout::Array(Box::new(Layout::of(module, *base, structures)?), count.get() as usize))
            }
            TypeInner::Struct { members, .. } => {
                let (name, written) = structures.get(&kind).ok_or("a structure without a name")?;
                let member = |(member, wgsl): (&naga::StructMember, &String)| {
                    let layout = Layout::of(module, member.ty, structures)?;
                    Ok(Member { name: member.name.clone().unwrap_or_default(), wgsl: wgsl.clone(), layout })
                };
                Ok(Layout::Struct(name.clone(), members.iter().zip(written).map(member).collect::<Result<_, String>>()?))
            }
            _ => Err("a type that uniforms and varyings cannot have".into()),
        }
    }

    /// Number of vec4 slots.
    #[inline]
    pub fn slots(&self) -> usize {
        match self {
            Layout::Vector(..) => 1,
            Layout::Matrix(columns, _) => *columns,
            Layout::Array(element, count) => element.slots().saturating_mul(*count),
            Layout::Struct(_, members) => members.iter().map(|member| member.layout.slots()).sum(),
        }
    }

    /// Scalars, vectors and columns in slot order: the path of each in WGSL, its number of components, and its kind.
    pub fn leaves(&self, path: &str, out: &mut Vec<(String, usize, ScalarKind)>) {
        match self {
            Layout::Vector(n, kind) => out.push((path.to_owned(), *n, *kind)),
            Layout::Matrix(columns, rows) => {
                out.extend((0..*columns).map(|k| (format!("{path}[{k}]"), *rows, ScalarKind::Float)));
            }
            Layout::Array(element, count) => (0..*count).for_each(|k| element.leaves(&format!("{path}[{k}]"), out)),
            Layout::Struct(_, members) => {
                members.iter().for_each(|member| member.layout.leaves(&format!("{path}.{}", member.wgsl), out))
            }
        }
    }

    /// Its name in WGSL.
    fn name(&self) -> String {
        match self {
            Layout::Vector(n, kind) => vector_name(*n, *kind),
            Layout::Matrix(columns, rows) => format!("mat{columns}x{rows}f"),
            Layout::Array(element, count) => format!("array<{}, {count}>", element.name()),
            Layout::Struct(name, _) => name.clone(),
        }
    }

    /// The value as an expression of WGSL.
    fn value(&self, place: &ElementAddress) -> String {
        match self {
            Layout::Vector(n, kind) => {
                let all = format!("{}.{}", place.text(0), &"xyzw"[..*n]);
                match kind {
                    ScalarKind::Bool if *n == 1 => format!("({all} != 0.0)"),
                    ScalarKind::Bool => format!("({all} != vec{n}f())"),
                    ScalarKind::Sint | ScalarKind::Uint => format!("bitcast<{}>({all})", vector_name(*n, *kind)),
                    _ => all,
                }
            }
            Layout::Matrix(columns, rows) => {
                let column = |k: usize| format!("{}.{}", place.text(k), &"xyzw"[..*rows]);
                format!("{}({})", self.name(), (0..*columns).map(column).collect::<Vec<_>>().join(", "))
            }
            Layout::Array(element, count) => {
                let one = |k: usize| element.value(&place.moved(k * element.slots()));
                format!("{}({})", self.name(), (0..*count).map(one).collect::<Vec<_>>().join(", "))
            }
            Layout::Struct(name, members) => {
                let (mut at, mut list) = (0, Vec::new());
                for member in members {
                    list.push(member.layout.value(&place.moved(at)));
                    at += member.layout.slots();
                }
                format!("{name}({})", list.join(", "))
            }
        }
    }
}

/// A type of WGSL.
pub fn vector_name(n: usize, kind: ScalarKind) -> String {
    let scalar = match kind {
        ScalarKind::Sint => "i32",
        ScalarKind::Uint => "u32",
        ScalarKind::Bool => "bool",
        _ => "f32",
    };
    if n == 1 { scalar.into() } else { format!("vec{n}<{scalar}>") }
}

/// The position of a value: an array, a constant index, and the terms of the index that are not constant.
#[derive(Clone, Debug)]
struct ElementAddress {
    array: String,
    first: usize,
    terms: String,
}

impl ElementAddress {
    fn text(&self, k: usize) -> String {
        format!("{}[{}{}]", self.array, self.first + k, self.terms)
    }

    fn moved(&self, by: usize) -> ElementAddress {
        ElementAddress { first: self.first + by, ..self.clone() }
    }
}

/// A uniform in the text: its layout and first slot.
pub type Roots = BTreeMap<String, (Layout, usize)>;

/// The end of the name that begins at `from`.
fn name_end(text: &str, from: usize) -> usize {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text[from..].find(|c| !word(c)).map_or(text.len(), |k| from + k)
}

/// The position of the bracket that closes the one at `open`.
fn close(text: &str, open: usize) -> Option<usize> {
    let mut depth = 0;
    for (k, c) in text[open..].char_indices() {
        match c {
            '[' => depth += 1,
            ']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return Some(open + k);
        }
    }
    None
}

/// Replaces uniform names by their array elements in functions that naga wrote.
pub struct Substitution<'a> {
    /// Uniforms by name.
    pub roots: &'a Roots,
    /// The array of their values.
    pub array: &'a str,
    /// Local names of the current function that stand for whole arrays and structures.
    aliases: BTreeMap<String, (Layout, ElementAddress)>,
}

impl<'a> Substitution<'a> {
    /// Creates a substitution for these uniforms.
    pub fn new(roots: &'a Roots, array: &'a str) -> Substitution<'a> {
        Substitution { roots, array, aliases: BTreeMap::new() }
    }

    /// Substitutes in the text of functions.
    pub fn functions(&mut self, text: &str) -> Result<String, String> {
        let mut out = String::new();
        for line in text.lines() {
            if line.starts_with("fn ") {
                self.aliases.clear();
            }
            if let Some((name, value)) =
                line.trim().strip_prefix("let ").and_then(|rest| rest.strip_suffix(';')?.split_once(" = "))
                && let Some((layout, place, "")) = self.path(value)?
                && matches!(layout, Layout::Array(..) | Layout::Struct(..))
            {
                self.aliases.insert(name.to_owned(), (layout, place));
                continue;
            }
            out.push_str(&self.line(line)?);
            out.push('\n');
        }
        Ok(out)
    }

    fn line(&self, line: &str) -> Result<String, String> {
        let (mut out, mut at) = (String::new(), 0);
        while at < line.len() {
            let Some(c) = line[at..].chars().next() else { break };
            if !(c.is_ascii_alphanumeric() || c == '_') {
                out.push(c);
                at += c.len_utf8();
                continue;
            }
            let member = line[..at].ends_with('.');
            match self.path(&line[at..])? {
                Some((layout, place, rest)) if !member => {
                    let count = layout.slots();
                    if matches!(layout, Layout::Array(..) | Layout::Struct(..)) && count > WHOLE_MAX {
                        return Err(format!("a uniform of {count} vectors that is read as a whole, at most {WHOLE_MAX}"));
                    }
                    out.push_str(&layout.value(&place));
                    at = line.len() - rest.len();
                }
                _ => {
                    let end = name_end(line, at);
                    out.push_str(&line[at..end]);
                    at = end;
                }
            }
        }
        Ok(out)
    }

    /// The uniform, or part of one, at the start of a text, and the text after it; none if there is no uniform.
    fn path<'t>(&self, text: &'t str) -> Result<Option<(Layout, ElementAddress, &'t str)>, String> {
        let mut at = name_end(text, 0);
        let name = &text[..at];
        let (mut layout, mut place) = match (self.aliases.get(name), self.roots.get(name)) {
            (Some(alias), _) => alias.clone(),
            (None, Some((layout, first))) => {
                (layout.clone(), ElementAddress { array: self.array.to_owned(), first: *first, terms: String::new() })
            }
            (None, None) => return Ok(None),
        };
        loop {
            let rest = &text[at..];
            layout = match layout {
                Layout::Array(element, count) if rest.starts_with('[') => {
                    let end = close(text, at).ok_or("a bracket that is not closed")?;
                    let index = &text[at + 1..end];
                    match index.trim_end_matches(['i', 'u']).parse::<usize>() {
                        Ok(known) if known < count => place.first += known * element.slots(),
                        Ok(known) => return Err(format!("element {known} of an array of {count}")),
                        Err(_) => {
                            // An index out of range selects the last element.
                            let index = self.line(index)?;
                            place.terms += &format!(" + {} * min(u32({index}), {}u)", element.slots(), count.saturating_sub(1));
                        }
                    }
                    at = end + 1;
                    *element
                }
                Layout::Struct(name, members) if rest.starts_with('.') => {
                    let end = name_end(text, at + 1);
                    let wanted = &text[at + 1..end];
                    let mut first = 0;
                    let mut found = None;
                    for member in members {
                        if member.wgsl == wanted {
                            found = Some(member.layout);
                            break;
                        }
                        first += member.layout.slots();
                    }
                    let Some(kind) = found else { return Err(format!("no member {wanted} in {name}")) };
                    place.first += first;
                    at = end;
                    kind
                }
                other => return Ok(Some((other, place, rest))),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roots() -> Roots {
        let float = |n| Layout::Vector(n, ScalarKind::Float);
        let member = |name: &str, n| Member { name: name.into(), wgsl: name.into(), layout: float(n) };
        let light = Layout::Struct("Light".into(), vec![member("place", 3), member("power", 1)]);
        BTreeMap::from([
            ("scale".to_owned(), (float(1), 0)),
            ("on".to_owned(), (Layout::Vector(1, ScalarKind::Bool), 1)),
            ("turn".to_owned(), (Layout::Matrix(2, 2), 2)),
            ("lights".to_owned(), (Layout::Array(Box::new(light), 3), 4)),
        ])
    }

    fn of(text: &str) -> String {
        Substitution::new(&roots(), "p").functions(text).expect("a text")
    }

    #[test]
    fn names_become_vectors_of_the_array() {
        assert_eq!(of("    let _e1 = scale;"), "    let _e1 = p[0].x;\n");
        assert_eq!(of("    let _e1 = on;"), "    let _e1 = (p[1].x != 0.0);\n");
        assert_eq!(of("    let _e1 = turn;"), "    let _e1 = mat2x2f(p[2].xy, p[3].xy);\n");
        assert_eq!(of("    let _e1 = lights[1].power;"), "    let _e1 = p[7].x;\n");
        assert_eq!(of("    let _e2 = lights[_e1].place;"), "    let _e2 = p[4 + 2 * min(u32(_e1), 2u)].xyz;\n");
        assert_eq!(of("    scaled = other.scale;"), "    scaled = other.scale;\n");
    }

    #[test]
    fn a_whole_structure_is_read_where_its_members_are() {
        let text = "fn a() {\n    let _e1 = lights[2];\n    x = _e1.power;\n}\nfn b() {\n    y = _e1;\n}";
        assert_eq!(of(text), "fn a() {\n    x = p[9].x;\n}\nfn b() {\n    y = _e1;\n}\n");
        assert_eq!(of("    f(lights[0]);"), "    f(Light(p[4].xyz, p[5].x));\n");
    }
}
