//! The parser: tokens become a syntax tree.
//!
//! It needs no table of types: two words side by side, with brackets between them or not, begin a declaration. So words that later
//! versions reserve stay plain names where an old shader uses them as names.

use super::tokens::{Dialect, Token};
use super::tree::{
    Declaration, Declarator, Expr, ExprKind, Function, Interface, Item, Kind, Qualifier, Sizes, Statement, StatementKind,
};
use super::{TranslateResult, Wrong};

/// Words before a type.
const QUALIFIERS: &str = "const uniform attribute varying in out inout buffer shared flat smooth noperspective centroid sample patch \
    invariant precise highp mediump lowp coherent volatile restrict readonly writeonly";

/// Words that begin or continue a statement that is no declaration.
const STATEMENTS: [&str; 4] = ["return", "else", "do", "case"];

/// Operators between two operands. Operators of a later line bind more tightly.
const BINARY: [&[&str]; 11] = [
    &["||"],
    &["^^"],
    &["&&"],
    &["|"],
    &["^"],
    &["&"],
    &["==", "!="],
    &["<", ">", "<=", ">="],
    &["<<", ">>"],
    &["+", "-"],
    &["*", "/", "%"],
];

/// Operators that assign.
const ASSIGNMENTS: [&str; 11] = ["=", "+=", "-=", "*=", "/=", "%=", "<<=", ">>=", "&=", "^=", "|="];

/// Operators before an operand.
const PREFIXES: [&str; 6] = ["+", "-", "!", "~", "++", "--"];

/// The precedence of an operator between two operands.
pub fn binding(operator: &str) -> u8 {
    BINARY.iter().position(|level| level.contains(&operator)).unwrap_or(0) as u8
}

/// The declarations of a shader. `number` tells apart the structures without a name of several shaders.
///
/// # Errors
/// If the tokens are no shader: the line, what is expected there, and what was found.
pub fn parse(dialect: Dialect, tokens: &[Token], number: usize) -> TranslateResult<Vec<Item>> {
    let mut parser = Parser { dialect, tokens, at: 0, number };
    let mut items = Vec::new();
    while parser.at < tokens.len() {
        items.extend(parser.item()?);
    }
    Ok(items)
}

struct Parser<'a> {
    dialect: Dialect,
    tokens: &'a [Token],
    at: usize,
    number: usize,
}

impl Parser<'_> {
    fn text(&self, ahead: usize) -> &str {
        self.tokens.get(self.at + ahead).map_or("", |token| &token.text)
    }

    fn is(&self, text: &str) -> bool {
        self.text(0) == text
    }

    fn is_word(&self, ahead: usize) -> bool {
        self.tokens.get(self.at + ahead).is_some_and(|token| token.word)
    }

    /// The line of the next token, or the line of the last token at the end.
    fn line(&self) -> u32 {
        self.tokens.get(self.at).or(self.tokens.last()).map_or(0, |token| token.line)
    }

    /// The line of the token before.
    fn end(&self) -> u32 {
        self.at.checked_sub(1).map_or(0, |at| self.tokens[at].line)
    }

    fn wrong<T>(&self, expected: &str) -> TranslateResult<T> {
        let found = match self.tokens.get(self.at) {
            Some(token) => format!("`{}`", token.text),
            None => "the end of the shader".to_owned(),
        };
        Err(Wrong::at(self.line(), format!("{expected} is expected, not {found}")))
    }

    /// Takes the next token if it is this one.
    fn take(&mut self, text: &str) -> bool {
        let found = self.is(text);
        self.at += usize::from(found);
        found
    }

    fn expect(&mut self, text: &str) -> TranslateResult {
        if self.take(text) { Ok(()) } else { self.wrong(&format!("`{text}`")) }
    }

    /// Takes one of these tokens if it is the next one.
    fn take_one(&mut self, of: &[&'static str]) -> Option<&'static str> {
        let found = of.iter().copied().find(|text| self.is(text))?;
        self.at += 1;
        Some(found)
    }

    fn word(&mut self, what: &str) -> TranslateResult<String> {
        match self.tokens.get(self.at) {
            Some(token) if token.word => {
                self.at += 1;
                Ok(token.text.clone())
            }
            _ => self.wrong(what),
        }
    }

    /// A list with commas between its parts, up to the closing bracket, which is taken.
    fn list<T>(&mut self, close: &str, mut one: impl FnMut(&mut Self) -> TranslateResult<T>) -> TranslateResult<Vec<T>> {
        let mut list = Vec::new();
        if self.take(close) {
            return Ok(list);
        }
        loop {
            list.push(one(self)?);
            if self.take(close) {
                return Ok(list);
            }
            if !self.take(",") {
                return self.wrong(&format!("`,` or `{close}`"));
            }
        }
    }

    /// Skips `precision mediump float;`, which changes nothing here. Returns true if it is there.
    fn precision(&mut self) -> TranslateResult<bool> {
        let found = self.is("precision") && self.is_word(1);
        if found {
            while self.at < self.tokens.len() && !self.is(";") {
                self.at += 1;
            }
            self.expect(";")?;
        }
        Ok(found)
    }

    fn item(&mut self) -> TranslateResult<Option<Item>> {
        if self.take(";") || self.precision()? {
            return Ok(None);
        }
        let qualifiers = self.qualifiers()?;
        if !qualifiers.is_empty() && self.take(";") {
            return Ok(Some(Item::Default(qualifiers)));
        }
        let requalifies = qualifiers.iter().any(|of| matches!(of.word.as_str(), "invariant" | "precise"));
        if requalifies && self.is_word(0) && matches!(self.text(1), ";" | ",") {
            // `invariant gl_Position;`
            return self.list(";", |own| own.word("a name")).map(|_| None);
        }
        if self.is_word(0) && !self.is("struct") && self.text(1) == "{" {
            return Ok(Some(Item::Interface(self.interface(qualifiers)?)));
        }
        let kind = self.kind()?;
        if self.is_word(0) && self.text(1) == "(" {
            return Ok(Some(Item::Function(self.function(qualifiers, kind)?)));
        }
        Ok(Some(Item::Declaration(self.variables(qualifiers, kind)?)))
    }

    fn qualifiers(&mut self) -> TranslateResult<Vec<Qualifier>> {
        let mut list = Vec::new();
        loop {
            let line = self.line();
            let mut layout = Vec::new();
            if self.is("layout") && self.text(1) == "(" {
                self.at += 2;
                layout = self.list(")", |own| {
                    let name = own.word("a word of the layout")?;
                    let value = if own.take("=") { Some(own.choice()?) } else { None };
                    Ok((name, value))
                })?;
                list.push(Qualifier { line, word: "layout".to_owned(), layout });
                continue;
            }
            // Some of these words are names in an old shader.
            let is_qualifier = QUALIFIERS.split(' ').any(|word| self.is(word));
            if !is_qualifier || !self.is_word(1) && self.text(1) != ";" {
                return Ok(list);
            }
            list.push(Qualifier { line, word: self.word("a qualifier")?, layout });
        }
    }

    fn kind(&mut self) -> TranslateResult<Kind> {
        let line = self.line();
        if !self.is("struct") {
            return Ok(Kind { line, name: self.word("a type")?, members: None, sizes: self.sizes()? });
        }
        self.at += 1;
        // naga wants a name.
        let name = if self.is("{") { format!("glx_nameless{}_{}", self.number, self.at) } else { self.word("a name")? };
        self.expect("{")?;
        let members = self.members()?;
        Ok(Kind { line, name, members: Some(members), sizes: self.sizes()? })
    }

    /// The members of a structure or a block up to its closing bracket, which is taken.
    fn members(&mut self) -> TranslateResult<Vec<Declaration>> {
        let mut members = Vec::new();
        while !self.take("}") {
            let qualifiers = self.qualifiers()?;
            let kind = self.kind()?;
            members.push(self.variables(qualifiers, kind)?);
        }
        Ok(members)
    }

    fn sizes(&mut self) -> TranslateResult<Sizes> {
        let mut sizes = Vec::new();
        while self.take("[") {
            if self.take("]") {
                sizes.push(None);
            } else {
                sizes.push(Some(self.expression()?));
                self.expect("]")?;
            }
        }
        Ok(sizes)
    }

    fn declarator(&mut self) -> TranslateResult<Declarator> {
        let (line, name, sizes) = (self.line(), self.word("a name")?, self.sizes()?);
        let value = if self.take("=") { Some(self.initialiser()?) } else { None };
        Ok(Declarator { line, name, sizes, value })
    }

    fn initialiser(&mut self) -> TranslateResult<Expr> {
        let line = self.line();
        if !self.take("{") {
            return self.assignment();
        }
        let mut list = Vec::new();
        while !self.take("}") {
            list.push(self.initialiser()?);
            // The last value may have a comma behind it.
            if !self.take(",") && !self.is("}") {
                return self.wrong("`,` or `}`");
            }
        }
        Ok(Expr::new(line, ExprKind::List(list)))
    }

    /// The variables of a declaration and its semicolon.
    fn variables(&mut self, qualifiers: Vec<Qualifier>, kind: Kind) -> TranslateResult<Declaration> {
        let names = self.list(";", Self::declarator)?;
        Ok(Declaration { qualifiers, kind, names, end: self.end() })
    }

    fn interface(&mut self, qualifiers: Vec<Qualifier>) -> TranslateResult<Interface> {
        let (line, name) = (self.line(), self.word("a name")?);
        self.expect("{")?;
        let members = self.members()?;
        let instance = if self.is(";") { None } else { Some(self.declarator()?) };
        self.expect(";")?;
        Ok(Interface { line, qualifiers, name, members, instance })
    }

    fn function(&mut self, qualifiers: Vec<Qualifier>, kind: Kind) -> TranslateResult<Function> {
        let (line, name) = (self.line(), self.word("a name")?);
        self.expect("(")?;
        if self.is("void") && self.text(1) == ")" {
            self.at += 1;
        }
        let parameters = self.list(")", |own| {
            let (qualifiers, kind) = (own.qualifiers()?, own.kind()?);
            let names = if own.is_word(0) { vec![own.declarator()?] } else { Vec::new() };
            Ok(Declaration { qualifiers, kind, names, end: own.end() })
        })?;
        let body = if self.take(";") {
            None
        } else {
            if !self.take("{") {
                return self.wrong("`;` or `{`");
            }
            Some(self.block(false)?)
        };
        Ok(Function { line, qualifiers, kind, name, parameters, body, end: self.end() })
    }

    /// Statements up to the closing bracket, which is taken.
    fn block(&mut self, labels: bool) -> TranslateResult<Vec<Statement>> {
        let mut statements = Vec::new();
        while !self.take("}") {
            if self.at == self.tokens.len() {
                return self.wrong("`}`");
            }
            let line = self.line();
            if self.precision()? {
                continue;
            }
            let label = match self.text(0) {
                "case" if labels => {
                    self.at += 1;
                    Some(Some(self.expression()?))
                }
                "default" if labels && self.text(1) == ":" => {
                    self.at += 1;
                    Some(None)
                }
                _ => None,
            };
            statements.push(match label {
                Some(value) => {
                    self.expect(":")?;
                    Statement::new(line, StatementKind::Label(value))
                }
                None => self.statement()?,
            });
        }
        Ok(statements)
    }

    /// Returns true if a declaration begins here.
    fn is_declaration(&self) -> bool {
        if !self.is_word(0) || STATEMENTS.contains(&self.text(0)) {
            return false;
        }
        let mut next = 1;
        while self.text(next) == "[" {
            let Some(close) = super::tokens::closing(self.tokens, self.at + next) else { return false };
            next = close + 1 - self.at;
        }
        self.is("struct") || self.is_word(next)
    }

    fn declaration(&mut self) -> TranslateResult<Declaration> {
        let qualifiers = self.qualifiers()?;
        let kind = self.kind()?;
        self.variables(qualifiers, kind)
    }

    /// A statement that is the body of another statement. Its declarations have a scope of their own.
    fn body(&mut self) -> TranslateResult<Box<Statement>> {
        let statement = self.statement()?;
        Ok(Box::new(match statement.kind {
            StatementKind::Declaration(_) => Statement::new(statement.line, StatementKind::Block(vec![statement])),
            _ => statement,
        }))
    }

    fn bracketed(&mut self) -> TranslateResult<Expr> {
        self.expect("(")?;
        let expression = self.expression()?;
        self.expect(")")?;
        Ok(expression)
    }

    /// An expression, a declaration or nothing, up to its semicolon, which is taken.
    fn simple(&mut self) -> TranslateResult<Statement> {
        let line = self.line();
        if self.take(";") {
            return Ok(Statement::new(line, StatementKind::Empty));
        }
        if self.is_declaration() {
            return Ok(Statement::new(line, StatementKind::Declaration(self.declaration()?)));
        }
        let expression = self.expression()?;
        self.expect(";")?;
        Ok(Statement::new(line, StatementKind::Expression(expression)))
    }

    fn statement(&mut self) -> TranslateResult<Statement> {
        let line = self.line();
        let bracket = self.text(1) == "(";
        // `switch` is a name before version 1.30.
        let kind = match self.text(0) {
            "{" => {
                self.at += 1;
                StatementKind::Block(self.block(false)?)
            }
            "if" => {
                self.at += 1;
                let (condition, accept) = (self.bracketed()?, self.body()?);
                let reject = if self.take("else") { Some(self.body()?) } else { None };
                StatementKind::If(condition, accept, reject)
            }
            "for" => {
                self.at += 1;
                self.expect("(")?;
                let header = Box::new([self.simple()?, self.simple()?]);
                let step = if self.is(")") { None } else { Some(self.expression()?) };
                self.expect(")")?;
                StatementKind::For(header, step, self.body()?)
            }
            "while" => {
                self.at += 1;
                StatementKind::While(self.bracketed()?, self.body()?)
            }
            "do" => {
                self.at += 1;
                let body = self.body()?;
                self.expect("while")?;
                let condition = self.bracketed()?;
                self.expect(";")?;
                StatementKind::Do(body, condition)
            }
            "switch" if bracket && self.dialect.version >= 130 => {
                self.at += 1;
                let value = self.bracketed()?;
                self.expect("{")?;
                StatementKind::Switch(value, self.block(true)?)
            }
            "return" => {
                self.at += 1;
                let value = if self.is(";") { None } else { Some(self.expression()?) };
                self.expect(";")?;
                StatementKind::Return(value)
            }
            "break" | "continue" | "discard" => {
                let word = self.take_one(&["break", "continue", "discard"]).unwrap_or("break");
                self.expect(";")?;
                StatementKind::Jump(word)
            }
            _ => return self.simple(),
        };
        Ok(Statement::new(line, kind))
    }

    fn expression(&mut self) -> TranslateResult<Expr> {
        let line = self.line();
        let first = self.assignment()?;
        if !self.is(",") {
            return Ok(first);
        }
        let mut all = vec![first];
        while self.take(",") {
            all.push(self.assignment()?);
        }
        Ok(Expr::new(line, ExprKind::Sequence(all)))
    }

    fn assignment(&mut self) -> TranslateResult<Expr> {
        let target = self.choice()?;
        let line = self.line();
        match self.take_one(&ASSIGNMENTS) {
            Some(operator) => {
                let value = self.assignment()?;
                Ok(Expr::new(line, ExprKind::Assign(operator, Box::new(target), Box::new(value))))
            }
            None => Ok(target),
        }
    }

    fn choice(&mut self) -> TranslateResult<Expr> {
        let condition = self.binary(0)?;
        let line = self.line();
        if !self.take("?") {
            return Ok(condition);
        }
        let accept = self.expression()?;
        self.expect(":")?;
        let reject = self.assignment()?;
        Ok(Expr::new(line, ExprKind::Choice(Box::new([condition, accept, reject]))))
    }

    /// Operators that bind at least so tightly.
    fn binary(&mut self, tightness: usize) -> TranslateResult<Expr> {
        let mut left = self.unary()?;
        loop {
            let line = self.line();
            let mut levels = BINARY.iter().enumerate().skip(tightness);
            let Some((own, operator)) = levels.find_map(|(own, level)| Some((own, self.take_one(level)?))) else {
                return Ok(left);
            };
            let right = self.binary(own + 1)?;
            left = Expr::new(line, ExprKind::Binary(operator, Box::new(left), Box::new(right)));
        }
    }

    fn unary(&mut self) -> TranslateResult<Expr> {
        let line = self.line();
        match self.take_one(&PREFIXES) {
            Some(operator) => Ok(Expr::new(line, ExprKind::Prefix(operator, Box::new(self.unary()?)))),
            None => self.postfix(),
        }
    }

    fn postfix(&mut self) -> TranslateResult<Expr> {
        let mut of = self.primary()?;
        loop {
            let line = self.line();
            let kind = match self.text(0) {
                "[" => {
                    self.at += 1;
                    let index = self.expression()?;
                    self.expect("]")?;
                    ExprKind::Index(Box::new(of), Box::new(index))
                }
                "." => {
                    self.at += 1;
                    let name = self.word("a member")?;
                    if self.take("(") {
                        let arguments = self.list(")", Self::assignment)?;
                        ExprKind::Method(Box::new(of), name, arguments)
                    } else {
                        ExprKind::Member(Box::new(of), name)
                    }
                }
                _ => match self.take_one(&["++", "--"]) {
                    Some(operator) => ExprKind::Postfix(operator, Box::new(of)),
                    None => return Ok(of),
                },
            };
            of = Expr::new(line, kind);
        }
    }

    fn primary(&mut self) -> TranslateResult<Expr> {
        let line = self.line();
        if self.is("(") {
            return self.bracketed();
        }
        let Some(token) = self.tokens.get(self.at) else { return self.wrong("an expression") };
        if token.text.starts_with(|c: char| c.is_ascii_digit()) {
            self.at += 1;
            return Ok(Expr::number(line, &token.text));
        }
        if !token.word {
            return self.wrong("an expression");
        }
        let name = token.text.clone();
        self.at += 1;
        // `float[2](1.0, 2.0)`, unlike `a[2]`.
        let mut next = self.at;
        while self.tokens.get(next).is_some_and(|token| token.is("["))
            && let Some(close) = super::tokens::closing(self.tokens, next)
        {
            next = close + 1;
        }
        if !self.tokens.get(next).is_some_and(|token| token.is("(")) {
            return Ok(Expr::name(line, name));
        }
        let sizes = self.sizes()?;
        self.expect("(")?;
        if self.is("void") && self.text(1) == ")" {
            self.at += 1;
        }
        let arguments = self.list(")", Self::assignment)?;
        Ok(Expr::new(line, ExprKind::Call(name, sizes, arguments)))
    }
}
