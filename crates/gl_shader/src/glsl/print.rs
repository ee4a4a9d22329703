//! The printer: a syntax tree becomes tokens again.

use super::parse::binding;
use super::tokens::Token;
use super::tree::{Declaration, Declarator, Expr, ExprKind, Function, Kind, Qualifier, Sizes, Statement, StatementKind};

/// The precedence of forms of expressions, and the precedence that is added to that of operators between two operands.
const SEQUENCE: u8 = 0;
const ASSIGNMENT: u8 = 1;
const CHOICE: u8 = 2;
const BINARY: u8 = 3;
const UNARY: u8 = 20;
const POSTFIX: u8 = 21;

/// The tokens of a tree.
#[derive(Default)]
pub struct Printer {
    /// The tokens so far.
    pub out: Vec<Token>,
}

/// The words that are printed, with spaces between them.
pub fn words(print: impl FnOnce(&mut Printer)) -> String {
    let mut printer = Printer::default();
    print(&mut printer);
    printer.out.iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" ")
}

/// The words of an expression.
pub fn text(of: &Expr) -> String {
    words(|printer| printer.expr(of, SEQUENCE))
}

/// The precedence of an expression.
fn tightness(of: &Expr) -> u8 {
    match &of.kind {
        ExprKind::Sequence(_) => SEQUENCE,
        ExprKind::Assign(..) => ASSIGNMENT,
        ExprKind::Choice(_) => CHOICE,
        ExprKind::Binary(operator, ..) => BINARY + binding(operator),
        ExprKind::Prefix(..) => UNARY,
        _ => POSTFIX,
    }
}

impl Printer {
    fn put(&mut self, text: &str, line: u32) {
        self.out.push(Token::new(text, line));
    }

    /// Closes something on the line of the last token.
    fn close(&mut self, text: &str) {
        let line = self.out.last().map_or(0, |token| token.line);
        self.put(text, line);
    }

    /// Parts with commas between them.
    fn list<T>(&mut self, parts: &[T], mut one: impl FnMut(&mut Self, &T)) {
        for (k, part) in parts.iter().enumerate() {
            if k > 0 {
                self.close(",");
            }
            one(self, part);
        }
    }

    /// An expression, in brackets if its precedence is less than this.
    fn expr(&mut self, of: &Expr, at_least: u8) {
        let line = of.line;
        if tightness(of) < at_least {
            return self.bracketed(of);
        }
        match &of.kind {
            ExprKind::Name(name) => self.put(name, line),
            ExprKind::Number(number) => self.put(number, line),
            ExprKind::Prefix(operator, operand) => {
                self.put(operator, line);
                self.expr(operand, UNARY);
            }
            ExprKind::Postfix(operator, operand) => {
                self.expr(operand, POSTFIX);
                self.put(operator, line);
            }
            ExprKind::Binary(operator, left, right) => {
                let own = BINARY + binding(operator);
                self.expr(left, own);
                self.put(operator, line);
                self.expr(right, own + 1);
            }
            ExprKind::Assign(operator, target, value) => {
                self.expr(target, UNARY);
                self.put(operator, line);
                self.expr(value, ASSIGNMENT);
            }
            ExprKind::Choice(all) => {
                let [condition, accept, reject] = &**all;
                self.expr(condition, BINARY);
                self.put("?", line);
                self.expr(accept, ASSIGNMENT);
                self.close(":");
                self.expr(reject, CHOICE);
            }
            ExprKind::Sequence(all) => self.list(all, |own, of| own.expr(of, ASSIGNMENT)),
            ExprKind::Call(name, sizes, arguments) => {
                self.put(name, line);
                self.sizes(sizes, line);
                self.arguments(arguments);
            }
            ExprKind::Method(value, name, arguments) => {
                self.expr(value, POSTFIX);
                self.put(".", line);
                self.put(name, line);
                self.arguments(arguments);
            }
            ExprKind::Member(value, name) => {
                self.expr(value, POSTFIX);
                self.put(".", line);
                self.put(name, line);
            }
            ExprKind::Index(value, index) => {
                self.expr(value, POSTFIX);
                self.put("[", line);
                self.expr(index, SEQUENCE);
                self.close("]");
            }
            ExprKind::List(all) => {
                self.put("{", line);
                self.list(all, |own, of| own.expr(of, ASSIGNMENT));
                self.close("}");
            }
        }
    }

    fn arguments(&mut self, arguments: &[Expr]) {
        self.close("(");
        self.list(arguments, |own, of| own.expr(of, ASSIGNMENT));
        self.close(")");
    }

    /// Brackets.
    pub fn sizes(&mut self, sizes: &Sizes, line: u32) {
        for size in sizes {
            self.put("[", line);
            size.iter().for_each(|size| self.expr(size, SEQUENCE));
            self.close("]");
        }
    }

    fn qualifiers(&mut self, qualifiers: &[Qualifier]) {
        for qualifier in qualifiers {
            self.put(&qualifier.word, qualifier.line);
            if qualifier.word == "layout" {
                self.close("(");
                self.list(&qualifier.layout, |own, (name, value)| {
                    own.put(name, qualifier.line);
                    if let Some(value) = value {
                        own.close("=");
                        own.expr(value, CHOICE);
                    }
                });
                self.close(")");
            }
        }
    }

    fn kind(&mut self, of: &Kind) {
        if let Some(members) = &of.members {
            self.put("struct", of.line);
            self.put(&of.name, of.line);
            self.close("{");
            members.iter().for_each(|member| self.declaration(member));
            self.close("}");
        } else {
            self.put(&of.name, of.line);
        }
        self.sizes(&of.sizes, of.line);
    }

    fn declarator(&mut self, of: &Declarator) {
        self.put(&of.name, of.line);
        self.sizes(&of.sizes, of.line);
        if let Some(value) = &of.value {
            self.close("=");
            self.expr(value, ASSIGNMENT);
        }
    }

    /// A declaration without its semicolon.
    fn variables(&mut self, of: &Declaration) {
        self.qualifiers(&of.qualifiers);
        self.kind(&of.kind);
        self.list(&of.names, Self::declarator);
    }

    /// A declaration.
    pub fn declaration(&mut self, of: &Declaration) {
        self.variables(of);
        self.put(";", of.end);
    }

    fn block(&mut self, statements: &[Statement], line: u32) {
        self.put("{", line);
        statements.iter().for_each(|of| self.statement(of));
        self.close("}");
    }

    /// A statement.
    pub fn statement(&mut self, of: &Statement) {
        let line = of.line;
        match &of.kind {
            StatementKind::Empty => self.put(";", line),
            StatementKind::Block(all) => self.block(all, line),
            StatementKind::Declaration(of) => self.declaration(of),
            StatementKind::Expression(of) => {
                self.expr(of, SEQUENCE);
                self.close(";");
            }
            StatementKind::If(condition, accept, reject) => {
                self.put("if", line);
                self.bracketed(condition);
                match reject {
                    // The inner `if` would take the `else`.
                    Some(_) if ends_with_if(accept) => self.block(std::slice::from_ref(accept), line),
                    _ => self.statement(accept),
                }
                if let Some(reject) = reject {
                    self.put("else", reject.line);
                    self.statement(reject);
                }
            }
            StatementKind::For(header, step, body) => {
                self.put("for", line);
                self.close("(");
                header.iter().for_each(|of| self.statement(of));
                step.iter().for_each(|of| self.expr(of, SEQUENCE));
                self.close(")");
                self.statement(body);
            }
            StatementKind::While(condition, body) => {
                self.put("while", line);
                self.bracketed(condition);
                self.statement(body);
            }
            StatementKind::Do(body, condition) => {
                self.put("do", line);
                self.statement(body);
                self.close("while");
                self.bracketed(condition);
                self.close(";");
            }
            StatementKind::Switch(value, all) => {
                self.put("switch", line);
                self.bracketed(value);
                let line = self.out.last().map_or(line, |token| token.line);
                self.block(all, line);
            }
            StatementKind::Label(value) => {
                self.put(if value.is_some() { "case" } else { "default" }, line);
                value.iter().for_each(|of| self.expr(of, SEQUENCE));
                self.close(":");
            }
            StatementKind::Jump(word) => {
                self.put(word, line);
                self.close(";");
            }
            StatementKind::Return(value) => {
                self.put("return", line);
                value.iter().for_each(|of| self.expr(of, SEQUENCE));
                self.close(";");
            }
        }
    }

    fn bracketed(&mut self, of: &Expr) {
        self.close("(");
        self.expr(of, SEQUENCE);
        self.close(")");
    }

    /// A function.
    pub fn function(&mut self, of: &Function) {
        self.qualifiers(&of.qualifiers);
        self.kind(&of.kind);
        self.put(&of.name, of.line);
        self.close("(");
        self.list(&of.parameters, Self::variables);
        self.close(")");
        match &of.body {
            Some(body) => {
                self.close("{");
                body.iter().for_each(|of| self.statement(of));
                self.put("}", of.end);
            }
            None => self.put(";", of.end),
        }
    }
}

/// Returns true if an `else` behind a statement would belong to an `if` at its end.
fn ends_with_if(of: &Statement) -> bool {
    match &of.kind {
        StatementKind::If(_, _, None) => true,
        StatementKind::If(_, _, Some(body)) | StatementKind::For(_, _, body) | StatementKind::While(_, body) => {
            ends_with_if(body)
        }
        _ => false,
    }
}
