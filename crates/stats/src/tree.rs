//! The ordered tree of statistics.

use std::borrow::Cow;
use std::fmt::Write;

use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::{Map, Number, Value};

use super::{Declaration, Group};

/// One statistic.
#[derive(Clone, Debug, PartialEq)]
pub enum Leaf {
    /// A counter.
    Count(u64),
    /// A quotient of two counters, as a mean over cycles. 0/0 is 0.
    Ratio {
        /// What is divided.
        numerator: u64,
        /// By what.
        denominator: u64,
    },
    /// A property that does not accumulate, as a capacity.
    Level(u64),
    /// A real property that does not accumulate.
    Real(f64),
    /// A name.
    Text(String),
}

impl Leaf {
    /// The weighted sum of leaves of one kind, as in [`Tree::weighted`].
    fn weighted<'l>(&self, parts: impl Iterator<Item = (f64, &'l Leaf)>) -> Leaf {
        let (mut sums, mut weights) = ([0.0; 2], 0.0);
        for (weight, leaf) in parts {
            weights += weight;
            match leaf {
                Leaf::Count(value) => sums[0] += weight * *value as f64,
                Leaf::Ratio { numerator, denominator } => {
                    sums[0] += weight * *numerator as f64;
                    sums[1] += weight * *denominator as f64;
                }
                Leaf::Real(value) => sums[0] += weight * value,
                Leaf::Level(_) | Leaf::Text(_) => {}
            }
        }
        match self {
            Leaf::Count(_) => Leaf::Count(sums[0].round() as u64),
            Leaf::Ratio { .. } => Leaf::Ratio { numerator: sums[0].round() as u64, denominator: sums[1].round() as u64 },
            Leaf::Real(_) => Leaf::Real(if weights > 0.0 { sums[0] / weights } else { 0.0 }),
            Leaf::Level(_) | Leaf::Text(_) => self.clone(),
        }
    }

    /// The value, unless it is a text.
    pub fn number(&self) -> Option<f64> {
        match self {
            Leaf::Count(value) | Leaf::Level(value) => Some(*value as f64),
            Leaf::Ratio { numerator, denominator } => Some(quotient(*numerator, *denominator)),
            Leaf::Real(value) => Some(*value),
            Leaf::Text(_) => None,
        }
    }

    /// The text; empty if it is none.
    pub fn text(&self) -> &str {
        if let Leaf::Text(text) = self { text } else { "" }
    }

    /// As a JSON number or string; a real that is not finite becomes null, which JSON has no number for.
    fn json(&self) -> Value {
        match self {
            Leaf::Count(value) | Leaf::Level(value) => Value::from(*value),
            Leaf::Ratio { numerator, denominator } => real(quotient(*numerator, *denominator)),
            Leaf::Real(value) => real(*value),
            Leaf::Text(text) => Value::from(text.as_str()),
        }
    }

    /// Puts it at the end of a CSV row, quoted where it must be.
    fn put_csv(&self, row: &mut String) {
        match self {
            Leaf::Text(text) => row.push_str(&csv_field(text)),
            Leaf::Count(value) | Leaf::Level(value) => {
                let _ = write!(row, "{value}");
            }
            other => {
                let _ = write!(row, "{}", other.json());
            }
        }
    }
}

/// As [`Tree::json`] has it.
impl Serialize for Leaf {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Leaf::Count(value) | Leaf::Level(value) => serializer.serialize_u64(*value),
            Leaf::Text(text) => serializer.serialize_str(text),
            other => other.json().serialize(serializer),
        }
    }
}

/// Text as one field of a CSV row, quoted where it must be (RFC 4180).
///
/// Spreadsheets run a cell that begins with `=`, `+`, `-`, `@`, a tab or a carriage return as a formula, and labels come from traces that nobody
/// vouches for. Such a field gets an apostrophe in front, which spreadsheets take as the mark of text. Numbers stay as they are.
pub fn csv_field(text: &str) -> Cow<'_, str> {
    let formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text.parse::<f64>().is_err();
    let quoted = formula || text.bytes().any(|byte| matches!(byte, b',' | b'"' | b'\n' | b'\r'));
    if !quoted {
        return Cow::Borrowed(text);
    }
    let mark = if formula { "'" } else { "" };
    Cow::Owned(format!("\"{mark}{}\"", text.replace('"', "\"\"")))
}

fn quotient(numerator: u64, denominator: u64) -> f64 {
    if denominator == 0 { 0.0 } else { numerator as f64 / denominator as f64 }
}

fn real(value: f64) -> Value {
    Number::from_f64(value).map_or(Value::Null, Value::Number)
}

/// A leaf, a subtree or a numbered list of subtrees.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// A statistic.
    Leaf(Leaf),
    /// Named statistics.
    Tree(Tree),
    /// One subtree for each of several units of a kind: `NAME[i]`.
    List(Vec<Tree>),
}

/// The largest count that is read from a file: a real number has no more digits.
const EXACT: u64 = 1 << f64::MANTISSA_DIGITS;

impl Node {
    /// The subtrees: one, or one for each unit. None where this is a leaf.
    pub fn trees(&self) -> &[Tree] {
        match self {
            Node::Leaf(_) => &[],
            Node::Tree(tree) => std::slice::from_ref(tree),
            Node::List(list) => list,
        }
    }

    /// The node that [`Tree::json`] has written as this value. None where it writes no such value.
    pub fn from_json(value: &Value) -> Option<Node> {
        Some(match value {
            Value::Null | Value::Bool(_) => return None,
            Value::Number(number) => {
                let whole = number.as_u64().filter(|&count| count <= EXACT);
                Node::Leaf(whole.map_or(Leaf::Real(number.as_f64()?), Leaf::Count))
            }
            Value::String(text) => Node::Leaf(Leaf::Text(text.clone())),
            Value::Array(list) => Node::List(list.iter().map(Tree::from_json).collect()),
            Value::Object(_) => Node::Tree(Tree::from_json(value)),
        })
    }
}

/// As [`Tree::json`] has it.
impl Serialize for Node {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Node::Leaf(leaf) => leaf.serialize(serializer),
            Node::Tree(tree) => tree.serialize(serializer),
            Node::List(list) => list.serialize(serializer),
        }
    }
}

/// The name of an entry. Nearly all are declared in the code: trees of them are made for each frame, without a copy of any name.
type Name = Cow<'static, str>;

/// Named statistics in the order in which they were added.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree {
    entries: Vec<(Name, Node)>,
}

/// As [`Tree::json`] has it.
impl Serialize for Tree {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.entries.len()))?;
        self.entries.iter().try_for_each(|(name, node)| map.serialize_entry(name, node))?;
        map.end()
    }
}

impl Tree {
    /// An empty tree.
    pub fn new() -> Tree {
        Tree::default()
    }

    /// An empty tree with room for `entries` entries.
    pub fn with_capacity(entries: usize) -> Tree {
        Tree { entries: Vec::with_capacity(entries) }
    }

    /// Makes room for `entries` more entries.
    pub fn reserve(&mut self, entries: usize) {
        self.entries.reserve_exact(entries);
    }

    /// Sets an entry; one of the same name is replaced in its place.
    pub fn set(&mut self, name: impl Into<Cow<'static, str>>, node: Node) {
        self.put(name.into(), node);
    }

    fn put(&mut self, name: Name, node: Node) {
        match self.entries.iter_mut().find(|(known, _)| *known == name) {
            Some((_, place)) => *place = node,
            None => self.entries.push((name, node)),
        }
    }

    /// Adds a counter.
    pub fn count(&mut self, name: &'static str, value: u64) {
        self.put(name.into(), Node::Leaf(Leaf::Count(value)));
    }

    /// Adds a quotient of two counters.
    pub fn ratio(&mut self, name: &'static str, numerator: u64, denominator: u64) {
        self.put(name.into(), Node::Leaf(Leaf::Ratio { numerator, denominator }));
    }

    /// Adds a whole-numbered property.
    pub fn level(&mut self, name: &'static str, value: u64) {
        self.put(name.into(), Node::Leaf(Leaf::Level(value)));
    }

    /// Adds a real property.
    pub fn real(&mut self, name: &'static str, value: f64) {
        self.put(name.into(), Node::Leaf(Leaf::Real(value)));
    }

    /// Adds a name.
    pub fn text(&mut self, name: &'static str, value: &str) {
        self.put(name.into(), Node::Leaf(Leaf::Text(value.to_owned())));
    }

    /// The subtree of that name, made when there is none.
    pub fn child(&mut self, name: impl Into<Cow<'static, str>>) -> &mut Tree {
        let name = name.into();
        let found = self.entries.iter().position(|(known, node)| *known == name && matches!(node, Node::Tree(_)));
        match &mut self.place(found, name, Node::Tree(Tree::new())).1 {
            Node::Tree(tree) => tree,
            _ => unreachable!("it is a subtree"),
        }
    }

    /// The entry at a place, or if there is none, a new one, which replaces one of its name.
    fn place(&mut self, found: Option<usize>, name: Name, new: Node) -> &mut (Name, Node) {
        let at = found.unwrap_or_else(|| {
            let at = self.entries.iter().position(|(known, _)| *known == name).unwrap_or(self.entries.len());
            self.put(name, new);
            at
        });
        &mut self.entries[at]
    }

    /// Element `index` of the list of that name; list and elements are made when they are missing.
    pub fn element(&mut self, name: &'static str, index: usize) -> &mut Tree {
        let found = self.entries.iter().position(|(known, node)| known == name && matches!(node, Node::List(_)));
        match &mut self.place(found, name.into(), Node::List(Vec::new())).1 {
            Node::List(list) => {
                if list.len() <= index {
                    list.resize_with(index + 1, Tree::new);
                }
                &mut list[index]
            }
            _ => unreachable!("it is a list"),
        }
    }

    /// Adds all entries of another tree.
    pub fn extend(&mut self, other: Tree) {
        if self.entries.capacity() == 0 {
            self.entries = other.entries;
            return;
        }
        self.entries.reserve(other.entries.len());
        other.entries.into_iter().for_each(|(name, node)| self.put(name, node));
    }

    /// The entries in order.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &Node)> {
        self.entries.iter().map(|(name, node)| (name.as_ref(), node))
    }

    /// The entry at a path such as `units.setup[2].busy`.
    pub fn get(&self, path: &str) -> Option<&Node> {
        let (step, rest) = path.split_once('.').map_or((path, None), |(step, rest)| (step, Some(rest)));
        let (name, index) = match step.split_once('[') {
            Some((name, index)) => (name, Some(index.strip_suffix(']')?.parse::<usize>().ok()?)),
            None => (step, None),
        };
        let node = &self.entries.iter().find(|(known, _)| known == name)?.1;
        match (node, index, rest) {
            (Node::List(list), Some(index), Some(rest)) => list.get(index)?.get(rest),
            (Node::Tree(tree), None, Some(rest)) => tree.get(rest),
            (node, None, None) => Some(node),
            _ => None,
        }
    }

    /// The leaf at a path that a user has given, or a test, as a number. `None` when there is none or it is a text. Readers that know the counter use
    /// its declaration: [`Heading`](crate::Heading), [`Key`](crate::Key).
    pub fn number(&self, path: &str) -> Option<f64> {
        match self.get(path)? {
            Node::Leaf(leaf) => leaf.number(),
            _ => None,
        }
    }

    /// The statistic of this tree that is declared so. None where there is none.
    pub fn leaf(&self, declaration: &Declaration) -> Option<&Leaf> {
        match self.get(declaration.name)? {
            Node::Leaf(leaf) => Some(leaf),
            _ => None,
        }
    }

    /// Whether this tree has a counter of a group.
    pub fn has<G: Group>(&self) -> bool {
        G::DECLARATIONS.iter().any(|counter| self.leaf(counter).is_some())
    }

    /// The counters of this tree. Those that are not there are 0.
    pub fn read<G: Group>(&self) -> G {
        G::collect(|name| match self.get(name) {
            Some(Node::Leaf(Leaf::Count(value))) => *value,
            // Files of other programs may have any number.
            Some(Node::Leaf(leaf)) => (leaf.number().unwrap_or(0.0) as u64).min(EXACT),
            _ => 0,
        })
    }

    /// The sum of trees of one shape, each counter by its tree's weight, rounded; of quotients, that of the sums; of real properties,
    /// the weighted mean. What does not accumulate is the first's.
    pub fn weighted(parts: &[(f64, &Tree)]) -> Tree {
        let Some((_, first)) = parts.first() else { return Tree::new() };
        let node = |at: usize, name: &str, node: &Node| {
            let others = || parts.iter().filter_map(|(weight, tree)| Some((*weight, tree.entry(at, name)?)));
            match node {
                Node::Leaf(leaf) => Node::Leaf(leaf.weighted(others().filter_map(|(weight, node)| match node {
                    Node::Leaf(leaf) => Some((weight, leaf)),
                    _ => None,
                }))),
                Node::Tree(_) => {
                    let children = others().filter_map(|(weight, node)| match node {
                        Node::Tree(tree) => Some((weight, tree)),
                        _ => None,
                    });
                    Node::Tree(Tree::weighted(&children.collect::<Vec<_>>()))
                }
                Node::List(list) => {
                    let element = |index| {
                        others().filter_map(move |(weight, node)| match node {
                            Node::List(list) => list.get(index).map(|tree| (weight, tree)),
                            _ => None,
                        })
                    };
                    let elements = (0..list.len()).map(|index| Tree::weighted(&element(index).collect::<Vec<_>>()));
                    Node::List(elements.collect())
                }
            }
        };
        let entries = first.entries.iter().enumerate();
        Tree { entries: entries.map(|(at, (name, of))| (name.clone(), node(at, name, of))).collect() }
    }

    /// The entry of a name, which stands at a place in trees of the same shape.
    fn entry(&self, at: usize, name: &str) -> Option<&Node> {
        match self.entries.get(at) {
            Some((known, node)) if known == name => Some(node),
            _ => self.entries.iter().find(|(known, _)| known == name).map(|(_, node)| node),
        }
    }

    /// The tree with one subtree for each list: counters are summed over the units of a bank, quotients are those of the sums, real
    /// properties are means, and what does not accumulate is the first unit's.
    pub fn banks_summed(&self) -> Tree {
        let node = |node: &Node| match node {
            Node::Leaf(leaf) => Node::Leaf(leaf.clone()),
            Node::Tree(tree) => Node::Tree(tree.banks_summed()),
            Node::List(list) => {
                Node::Tree(Tree::weighted(&list.iter().map(|tree| (1.0, tree)).collect::<Vec<_>>()).banks_summed())
            }
        };
        Tree { entries: self.entries.iter().map(|(name, of)| (name.clone(), node(of))).collect() }
    }

    /// The tree of a JSON object such as [`Tree::json`] writes; empty where it is none.
    pub fn from_json(value: &Value) -> Tree {
        let node = |(name, value): (&String, &Value)| Some((name.clone().into(), Node::from_json(value)?));
        Tree { entries: value.as_object().into_iter().flatten().filter_map(node).collect() }
    }

    /// The tree as a JSON object, in order.
    pub fn json(&self) -> Value {
        let mut map = Map::new();
        for (name, node) in &self.entries {
            let value = match node {
                Node::Leaf(leaf) => leaf.json(),
                Node::Tree(tree) => tree.json(),
                Node::List(list) => Value::Array(list.iter().map(Tree::json).collect()),
            };
            map.insert(name.clone().into_owned(), value);
        }
        Value::Object(map)
    }

    /// Calls `visit` with the path and the value of every leaf, in order.
    pub fn leaves(&self, visit: &mut impl FnMut(&str, &Leaf)) {
        self.walk(&mut String::new(), visit);
    }

    fn walk(&self, path: &mut String, visit: &mut impl FnMut(&str, &Leaf)) {
        let length = path.len();
        for (name, node) in &self.entries {
            if length > 0 {
                path.push('.');
            }
            path.push_str(name);
            match node {
                Node::Leaf(leaf) => visit(path, leaf),
                Node::Tree(tree) => tree.walk(path, visit),
                Node::List(list) => {
                    let stem = path.len();
                    for (index, tree) in list.iter().enumerate() {
                        path.push_str(&format!("[{index}]"));
                        tree.walk(path, visit);
                        path.truncate(stem);
                    }
                }
            }
            path.truncate(length);
        }
    }

    /// The header of a CSV table of such trees: the paths of all leaves.
    pub fn csv_header(&self) -> String {
        let mut fields = Vec::new();
        self.leaves(&mut |path, _| fields.push(path.to_owned()));
        fields.join(",")
    }

    /// The row of a CSV table that belongs to [`Tree::csv_header`] of a tree of the same shape.
    pub fn csv_row(&self) -> String {
        let mut row = Row::default();
        self.put_csv(&mut row);
        row.text
    }

    fn put_csv(&self, row: &mut Row) {
        self.entries.iter().for_each(|(_, node)| match node {
            Node::Leaf(leaf) => row.put(leaf),
            Node::Tree(tree) => tree.put_csv(row),
            Node::List(list) => list.iter().for_each(|tree| tree.put_csv(row)),
        });
    }
}

/// A row of a CSV table.
#[derive(Default)]
struct Row {
    text: String,
    fields: usize,
}

impl Row {
    fn put(&mut self, leaf: &Leaf) {
        if self.fields > 0 {
            self.text.push(',');
        }
        self.fields += 1;
        leaf.put_csv(&mut self.text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Heading;

    fn reading(items: u64, area: u64, cycles: u64) -> Tree {
        let mut tree = Tree::new();
        tree.text("class", "sort-middle, \"immediate\"");
        let setup = tree.child("units").element("setup", 1);
        setup.count("items", items);
        setup.ratio("mean_occupancy", area, cycles);
        setup.level("capacity", 8);
        tree
    }

    #[test]
    fn a_text_is_one_field_that_no_spreadsheet_runs() {
        let plain = ["shadow pass", "", "1-2", "-0.5", "+3", "-1e9", "a=b", "-inf"];
        assert_eq!(plain.map(csv_field), plain);
        assert_eq!(csv_field("a \"b\", c"), "\"a \"\"b\"\", c\"");
        let formulas = ["=HYPERLINK(\"http://x\",\"y\")|cmd", "-1+1", "+a", "@SUM(1)", "\t=1", "\r=1", "="];
        for text in formulas {
            let expected = format!("\"'{}\"", text.replace('"', "\"\""));
            assert_eq!(csv_field(text), expected);
        }
    }

    #[test]
    fn json_has_the_names_in_order_and_numbered_units_as_arrays() {
        let json = reading(7, 30, 10).json().to_string();
        let expected =
            r#"{"class":"sort-middle, \"immediate\"","units":{"setup":[{},{"items":7,"mean_occupancy":3.0,"capacity":8}]}}"#;
        assert_eq!(json, expected);
    }

    #[test]
    fn counters_are_read_back_and_summed_over_units() {
        let cycles = |busy| crate::Cycles { busy, idle: 1, ..Default::default() };
        let mut tree = Tree::new();
        for (unit, busy) in [(0, 3), (1, 4)] {
            tree.child("units").element("setup", unit).extend(cycles(busy).tree());
        }
        tree.child("one").extend(cycles(9).tree());
        let of = |path| Heading::new(path, "").sum::<crate::Cycles>(&tree);
        assert_eq!(of("units.setup"), crate::Cycles { busy: 7, idle: 2, ..Default::default() });
        assert_eq!(of("one"), cycles(9));
        assert_eq!(of("units.core"), crate::Cycles::default());
    }

    #[test]
    fn a_tree_is_read_back_from_its_json() {
        let tree = reading(7, 30, 10);
        let read = Tree::from_json(&tree.json());
        assert_eq!(read.json(), tree.json());
        assert_eq!((read.number("units.setup[1].items"), read.number("units.setup[1].mean_occupancy")), (Some(7.0), Some(3.0)));
        assert_eq!(Tree::from_json(&serde_json::json!({ "a": null, "b": [1], "c": -1 })).number("c"), Some(-1.0));
        assert_eq!(Tree::from_json(&Value::Null), Tree::new());
    }

    #[test]
    fn csv_rows_fit_their_header() {
        let tree = reading(7, 0, 0);
        assert_eq!(tree.csv_header(), "class,units.setup[1].items,units.setup[1].mean_occupancy,units.setup[1].capacity");
        assert_eq!(tree.csv_row(), "\"sort-middle, \"\"immediate\"\"\",7,0.0,8");
    }
}
