//! The syntax tree of a shader.
//!
//! Brackets around expressions are not part of it: [`print`](super::print) writes the brackets that the precedence of operators needs.

/// An expression.
#[derive(Clone, Debug)]
pub struct Expr {
    /// The line of its name or operator.
    pub line: u32,
    /// The expression itself.
    pub kind: ExprKind,
}

/// The kinds of expressions.
#[derive(Clone, Debug)]
pub enum ExprKind {
    /// A variable, or `true` or `false`.
    Name(String),
    /// A number as it is written.
    Number(String),
    /// An operator before its operand.
    Prefix(&'static str, Box<Expr>),
    /// `++` or `--` after its operand.
    Postfix(&'static str, Box<Expr>),
    /// An operator between two operands that changes neither.
    Binary(&'static str, Box<Expr>, Box<Expr>),
    /// An assignment with its operator.
    Assign(&'static str, Box<Expr>, Box<Expr>),
    /// A condition, the value if it holds, and the value if it does not.
    Choice(Box<[Expr; 3]>),
    /// Expressions with commas between them.
    Sequence(Vec<Expr>),
    /// A call of a function or of a constructor; an array's constructor has sizes after its type.
    Call(String, Sizes, Vec<Expr>),
    /// A call of a function of a value: `a.length()`.
    Method(Box<Expr>, String, Vec<Expr>),
    /// A member of a structure, or components of a vector.
    Member(Box<Expr>, String),
    /// An element.
    Index(Box<Expr>, Box<Expr>),
    /// Values in braces.
    List(Vec<Expr>),
}

/// The sizes of an array of arrays, outermost first; none is there between empty brackets.
pub type Sizes = Vec<Option<Expr>>;

/// A qualifier of a declaration.
#[derive(Clone, Debug)]
pub struct Qualifier {
    /// Its line.
    pub line: u32,
    /// The word.
    pub word: String,
    /// The parts of `layout` and their values.
    pub layout: Vec<(String, Option<Expr>)>,
}

/// A type.
#[derive(Clone, Debug)]
pub struct Kind {
    /// Its line.
    pub line: u32,
    /// Its name.
    pub name: String,
    /// The members of a structure that is declared with it.
    pub members: Option<Vec<Declaration>>,
    /// Brackets after it.
    pub sizes: Sizes,
}

/// A variable of a declaration.
#[derive(Clone, Debug)]
pub struct Declarator {
    /// Its line.
    pub line: u32,
    /// Its name.
    pub name: String,
    /// Brackets after it.
    pub sizes: Sizes,
    /// Its initialiser.
    pub value: Option<Expr>,
}

/// A declaration of variables, of a structure, or of both.
#[derive(Clone, Debug)]
pub struct Declaration {
    /// Words before the type.
    pub qualifiers: Vec<Qualifier>,
    /// The type.
    pub kind: Kind,
    /// The variables.
    pub names: Vec<Declarator>,
    /// The line of its last token.
    pub end: u32,
}

/// A statement.
#[derive(Clone, Debug)]
pub struct Statement {
    /// Its line.
    pub line: u32,
    /// The statement itself.
    pub kind: StatementKind,
}

/// The kinds of statements.
#[derive(Clone, Debug)]
pub enum StatementKind {
    /// `;`
    Empty,
    /// A block.
    Block(Vec<Statement>),
    /// A declaration.
    Declaration(Declaration),
    /// An expression.
    Expression(Expr),
    /// A condition and its branches.
    If(Expr, Box<Statement>, Option<Box<Statement>>),
    /// A loop: what runs before it and its condition, what runs after each iteration, and its body.
    For(Box<[Statement; 2]>, Option<Expr>, Box<Statement>),
    /// A loop with its condition.
    While(Expr, Box<Statement>),
    /// A loop whose condition follows the body.
    Do(Box<Statement>, Expr),
    /// A choice of statements among labels.
    Switch(Expr, Vec<Statement>),
    /// `case` with its value, or `default`.
    Label(Option<Expr>),
    /// `break`, `continue` or `discard`.
    Jump(&'static str),
    /// `return`.
    Return(Option<Expr>),
}

/// A function, or a prototype.
#[derive(Clone, Debug)]
pub struct Function {
    /// The line of its name.
    pub line: u32,
    /// Words before the type.
    pub qualifiers: Vec<Qualifier>,
    /// The type of its result.
    pub kind: Kind,
    /// Its name.
    pub name: String,
    /// Its parameters, each with its name; a prototype may name none.
    pub parameters: Vec<Declaration>,
    /// Its statements; none is there for a prototype.
    pub body: Option<Vec<Statement>>,
    /// The line of its last token.
    pub end: u32,
}

/// A block of variables that the stage shares with the program or with other stages.
#[derive(Clone, Debug)]
pub struct Interface {
    /// The line of its name.
    pub line: u32,
    /// Words before the name.
    pub qualifiers: Vec<Qualifier>,
    /// Its name.
    pub name: String,
    /// Its variables.
    pub members: Vec<Declaration>,
    /// The name of its instance.
    pub instance: Option<Declarator>,
}

/// A declaration at global scope.
#[derive(Clone, Debug)]
pub enum Item {
    /// Variables or structures.
    Declaration(Declaration),
    /// A function or a prototype.
    Function(Function),
    /// A block.
    Interface(Interface),
    /// Qualifiers for what follows: `layout(row_major) uniform;`.
    Default(Vec<Qualifier>),
}

impl Expr {
    /// An expression of this kind on this line.
    pub fn new(line: u32, kind: ExprKind) -> Expr {
        Expr { line, kind }
    }

    /// A variable.
    pub fn name(line: u32, name: impl Into<String>) -> Expr {
        Expr { line, kind: ExprKind::Name(name.into()) }
    }

    /// A number.
    pub fn number(line: u32, number: impl ToString) -> Expr {
        Expr { line, kind: ExprKind::Number(number.to_string()) }
    }

    /// A call of a function.
    pub fn call(line: u32, name: impl Into<String>, arguments: Vec<Expr>) -> Expr {
        Expr { line, kind: ExprKind::Call(name.into(), Vec::new(), arguments) }
    }

    /// An assignment to a variable.
    pub fn assign(line: u32, name: impl Into<String>, value: Expr) -> Expr {
        Expr { line, kind: ExprKind::Assign("=", Box::new(Expr::name(line, name)), Box::new(value)) }
    }

    /// Its name if it is a variable.
    pub fn as_name(&self) -> Option<&str> {
        if let ExprKind::Name(name) = &self.kind { Some(name) } else { None }
    }

    /// Its value if it is a whole number.
    pub fn as_number(&self) -> Option<u64> {
        if let ExprKind::Number(number) = &self.kind { number.trim_end_matches(['u', 'U']).parse().ok() } else { None }
    }

    /// Visits it, and then all that it consists of.
    pub fn each<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        visit(self);
        match &self.kind {
            ExprKind::Name(_) | ExprKind::Number(_) => {}
            ExprKind::Prefix(_, of) | ExprKind::Postfix(_, of) | ExprKind::Member(of, _) => of.each(visit),
            ExprKind::Binary(_, a, b) | ExprKind::Assign(_, a, b) | ExprKind::Index(a, b) => {
                [a, b].into_iter().for_each(|of| of.each(visit));
            }
            ExprKind::Choice(all) => all.iter().for_each(|of| of.each(visit)),
            ExprKind::Sequence(all) | ExprKind::List(all) => all.iter().for_each(|of| of.each(visit)),
            ExprKind::Call(_, sizes, arguments) => sizes.iter().flatten().chain(arguments).for_each(|of| of.each(visit)),
            ExprKind::Method(of, _, arguments) => {
                of.each(visit);
                arguments.iter().for_each(|of| of.each(visit));
            }
        }
    }

    /// Returns true if it or a part of it fulfils a condition.
    pub fn any(&self, mut test: impl FnMut(&Expr) -> bool) -> bool {
        let mut found = false;
        self.each(&mut |of| found = found || test(of));
        found
    }
}

/// Visits the expressions between brackets.
fn each_size<'a>(sizes: &'a Sizes, visit: &mut dyn FnMut(&'a Expr)) {
    sizes.iter().flatten().for_each(|size| size.each(visit));
}

impl Declarator {
    /// A variable that is no array.
    pub fn plain(line: u32, name: impl Into<String>, value: Option<Expr>) -> Declarator {
        Declarator { line, name: name.into(), sizes: Vec::new(), value }
    }

    /// Visits its expressions.
    pub fn each<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        each_size(&self.sizes, visit);
        self.value.iter().for_each(|value| value.each(visit));
    }
}

impl Kind {
    /// A plain type.
    pub fn plain(line: u32, name: impl Into<String>) -> Kind {
        Kind { line, name: name.into(), members: None, sizes: Vec::new() }
    }

    fn each<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        each_size(&self.sizes, visit);
        self.members.iter().flatten().for_each(|member| member.each(visit));
    }
}

impl Declaration {
    /// Visits its expressions.
    pub fn each<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        self.kind.each(visit);
        self.names.iter().for_each(|name| name.each(visit));
    }

    /// A declaration of one variable without qualifiers.
    pub fn plain(kind: Kind, name: Declarator) -> Declaration {
        Declaration { qualifiers: Vec::new(), kind, end: name.line, names: vec![name] }
    }

    /// Returns true if a qualifier is there.
    pub fn has(&self, word: &str) -> bool {
        self.qualifiers.iter().any(|qualifier| qualifier.word == word)
    }
}

impl Statement {
    /// A statement of this kind on this line.
    pub fn new(line: u32, kind: StatementKind) -> Statement {
        Statement { line, kind }
    }

    /// Visits all expressions of it and of the statements in it.
    pub fn each<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        match &self.kind {
            StatementKind::Empty | StatementKind::Jump(_) => {}
            StatementKind::Declaration(of) => of.each(visit),
            StatementKind::Expression(of) => of.each(visit),
            StatementKind::Label(of) | StatementKind::Return(of) => of.iter().for_each(|of| of.each(visit)),
            StatementKind::Block(all) => all.iter().for_each(|of| of.each(visit)),
            StatementKind::Switch(value, all) => {
                value.each(visit);
                all.iter().for_each(|of| of.each(visit));
            }
            StatementKind::If(condition, accept, reject) => {
                condition.each(visit);
                [accept].into_iter().chain(reject).for_each(|of| of.each(visit));
            }
            StatementKind::For(header, step, body) => {
                header.iter().for_each(|of| of.each(visit));
                step.iter().for_each(|of| of.each(visit));
                body.each(visit);
            }
            StatementKind::While(condition, body) | StatementKind::Do(body, condition) => {
                condition.each(visit);
                body.each(visit);
            }
        }
    }
}

impl Function {
    /// Visits all expressions of its statements.
    pub fn each<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        self.body.iter().flatten().for_each(|of| of.each(visit));
    }
}

impl Item {
    /// Visits all of its expressions.
    pub fn each<'a>(&'a self, visit: &mut dyn FnMut(&'a Expr)) {
        match self {
            Item::Declaration(of) => of.each(visit),
            Item::Function(of) => of.each(visit),
            Item::Interface(of) => of.members.iter().for_each(|member| member.each(visit)),
            Item::Default(_) => {}
        }
    }
}
