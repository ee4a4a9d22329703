//! Functions with samplers as parameters. naga's front end and WGSL have no such values, so each call gets a copy of the function for the
//! samplers that it names: the parameters are gone, and the samplers stand where they were.

use std::collections::BTreeMap;
use std::ops::Range;

use super::outline;
use super::sampler::sampler;
use super::tokens::{Dialect, Token, closing, parts};
use super::words::number_in_brackets;
use super::{TOKENS_MAX, TranslateResult, Wrong};

/// What the overloads of a function differ in, as far as samplers are concerned: its name, its number of parameters, and which of them are
/// samplers of which type.
type SamplerSignature = (String, usize, Vec<(usize, String)>);

/// The samplers that replace parameters, by the names of these: each as the tokens that name it.
type Chosen = BTreeMap<String, Vec<Token>>;

/// A function with sampler parameters, or a prototype of one.
struct Function {
    likeness: SamplerSignature,
    /// The places of its name, of the brackets around its parameters, and of what follows them.
    name: usize,
    close: usize,
    body: Range<usize>,
    /// Names of its sampler parameters.
    names: Vec<String>,
}

/// A declaration at global scope.
struct Item {
    /// Its tokens.
    whole: Range<usize>,
    /// If it is a function with sampler parameters.
    function: Option<Function>,
    /// Whether it declares samplers.
    samplers: bool,
}

/// The copies of functions of one stage.
#[derive(Default)]
struct Copies {
    /// Types of the program's samplers, and whether they are arrays.
    samplers: BTreeMap<String, (Token, bool)>,
    /// The functions of which there are copies.
    functions: Vec<SamplerSignature>,
    /// The function and the samplers of each copy, in the order in which calls to them were found.
    list: Vec<(SamplerSignature, Vec<Vec<Token>>)>,
    /// Their numbers, by the function and the text of the samplers.
    numbers: BTreeMap<(SamplerSignature, Vec<String>), usize>,
}

/// Replaces functions with sampler parameters in the shaders of a stage.
///
/// # Errors
/// If an argument for a sampler names none, or if the copies have too many tokens.
pub fn specialise(shaders: &mut [(Dialect, Vec<Token>)]) -> TranslateResult {
    let mut copies = Copies::default();
    let items: Vec<Vec<Item>> = shaders.iter().map(|(_, tokens)| items(tokens)).collect();
    copies.functions = items.iter().flatten().filter_map(|item| Some(item.function.as_ref()?.likeness.clone())).collect();
    if copies.functions.is_empty() {
        return Ok(());
    }
    let all = || shaders.iter().zip(&items).flat_map(|((_, tokens), items)| items.iter().map(move |item| (tokens, item)));
    for (tokens, item) in all().filter(|(_, item)| item.samplers) {
        copies.declare(&tokens[item.whole.clone()]);
    }
    // Calls outside of such functions, then those in copies, which find further ones.
    for (tokens, item) in all().filter(|(_, item)| item.function.is_none()) {
        copies.replaced(&tokens[item.whole.clone()], &Chosen::new())?;
    }
    let (mut number, mut size) = (0, 0);
    while number < copies.list.len() {
        for (tokens, item) in all() {
            let Some(function) = item.function.as_ref().filter(|function| copies.list[number].0 == function.likeness) else {
                continue;
            };
            size += item.whole.len();
            if size > TOKENS_MAX {
                let what = format!("more than {TOKENS_MAX} tokens of functions that are copied for their samplers");
                return Err(Wrong::at(tokens[function.name].line, what));
            }
            let chosen = copies.chosen(number, function);
            copies.replaced(&tokens[function.body.clone()], &chosen)?;
        }
        number += 1;
    }
    for ((_, tokens), items) in shaders.iter_mut().zip(&items) {
        // Copies name samplers that may have been declared after the function.
        let (declarations, others): (Vec<&Item>, Vec<&Item>) = items.iter().partition(|item| item.samplers);
        let mut out: Vec<Token> = declarations.iter().flat_map(|item| &tokens[item.whole.clone()]).cloned().collect();
        for item in others {
            match &item.function {
                None => out.extend(copies.replaced(&tokens[item.whole.clone()], &Chosen::new())?),
                Some(function) => {
                    for number in 0..copies.list.len() {
                        if copies.list[number].0 == function.likeness {
                            copies.write(number, tokens, item.whole.start, function, &mut out)?;
                        }
                    }
                }
            }
        }
        *tokens = out;
    }
    Ok(())
}

/// The declarations at global scope.
fn items(tokens: &[Token]) -> Vec<Item> {
    let of = |item: outline::Item| {
        let declared = &tokens[item.whole.clone()];
        let samplers = item.function.is_none()
            && declared.iter().any(|token| token.is("uniform"))
            && declared.iter().any(|token| sampler(&token.text).is_some());
        let function = item.function.and_then(|of| function(tokens, of.open, of.close, item.whole.end));
        Item { whole: item.whole, function, samplers }
    };
    outline::items(tokens).into_iter().map(of).collect()
}

/// The type of a sampler, or that of an array of samplers.
fn kind_of(kind: &Token, array: bool) -> String {
    format!("{}{}", kind.text, if array { "[]" } else { "" })
}

/// A function whose parameters are between these brackets; none if there is no sampler among them.
fn function(tokens: &[Token], open: usize, close: usize, end: usize) -> Option<Function> {
    let parameters = parts(tokens.get(open + 1..close)?);
    let (mut kinds, mut names) = (Vec::new(), Vec::new());
    for (k, parameter) in parameters.iter().enumerate() {
        let Some(at) = parameter.iter().position(|token| sampler(&token.text).is_some()) else { continue };
        // A prototype may have no names; brackets stand before the name or after it.
        let name = parameter[at + 1..].iter().find(|token| token.word);
        let array = parameter[at + 1..].iter().any(|token| token.is("["));
        names.push(name.map_or(String::new(), |name| name.text.clone()));
        kinds.push((k, kind_of(&parameter[at], array)));
    }
    let likeness = (tokens[open - 1].text.clone(), parameters.len(), kinds);
    (!names.is_empty()).then(|| Function { likeness, name: open - 1, close, body: close + 1..end, names })
}

impl Copies {
    /// Notes the samplers of a declaration.
    fn declare(&mut self, tokens: &[Token]) {
        let Some(at) = tokens.iter().position(|token| sampler(&token.text).is_some()) else { return };
        let (kind, mut names) = (&tokens[at], tokens.get(at + 1..tokens.len() - 1).unwrap_or(&[]));
        // `sampler2D[2] name`
        let array = number_in_brackets(names).is_some();
        names = if array { &names[3..] } else { names };
        for declarator in parts(names) {
            if let Some(name) = declarator.first() {
                self.samplers.insert(name.text.clone(), (kind.clone(), array || declarator.len() > 1));
            }
        }
    }

    /// The samplers of a copy of this function.
    fn chosen(&self, number: usize, function: &Function) -> Chosen {
        function.names.iter().cloned().zip(self.list[number].1.iter().cloned()).collect()
    }

    /// These tokens with samplers in place of the parameters that `chosen` has, and calls of copies.
    fn replaced(&mut self, tokens: &[Token], chosen: &Chosen) -> TranslateResult<Vec<Token>> {
        let (mut out, mut at) = (Vec::with_capacity(tokens.len()), 0);
        while let Some(token) = tokens.get(at) {
            at += 1;
            if !token.word || at > 1 && tokens[at - 2].is(".") {
                out.push(token.clone());
                continue;
            }
            if let Some(sampler) = chosen.get(&token.text) {
                out.extend(sampler.iter().map(|of| Token::new(of.text.clone(), token.line)));
                continue;
            }
            let called = tokens.get(at).is_some_and(|next| next.is("(")) && self.functions.iter().any(|of| token.is(&of.0));
            let Some(close) = called.then(|| closing(tokens, at)).flatten() else {
                out.push(token.clone());
                continue;
            };
            let arguments = parts(&tokens[at + 1..close]);
            let Some((number, of)) = self.copy(token, &arguments, chosen)? else {
                out.push(token.clone());
                continue;
            };
            out.push(Token::new(copy_name(number, &token.text), token.line));
            let mut between = "(";
            for (k, argument) in arguments.into_iter().enumerate() {
                if of.2.iter().all(|&(at, _)| at != k) {
                    out.push(Token::new(between, token.line));
                    out.extend(self.replaced(argument, chosen)?);
                    between = ",";
                }
            }
            if between == "(" {
                out.push(Token::new(between, token.line));
            }
            out.push(tokens[close].clone());
            at = close + 1;
        }
        Ok(out)
    }

    /// The copy that a call with these arguments needs; none if it is that of a function without samplers.
    fn copy(
        &mut self,
        name: &Token,
        arguments: &[&[Token]],
        chosen: &Chosen,
    ) -> TranslateResult<Option<(usize, SamplerSignature)>> {
        let named: Vec<_> = arguments.iter().map(|argument| self.named(argument, chosen)).collect();
        let overloads = || self.functions.iter().filter(|of| name.is(&of.0) && of.1 == arguments.len());
        let fits =
            |of: &&SamplerSignature| of.2.iter().all(|(k, kind)| named[*k].as_ref().is_some_and(|(known, _)| known == kind));
        let Some(of) = overloads().find(fits).cloned() else {
            let known = |argument: &&[Token]| argument.first().is_some_and(|first| self.samplers.contains_key(&first.text));
            if overloads().next().is_some() && arguments.iter().any(known) {
                let what = format!("a call of the function {} whose samplers are not those of its parameters", name.text);
                return Err(Wrong::at(name.line, format!("{what} is not supported")));
            }
            return Ok(None);
        };
        let samplers: Vec<Vec<Token>> = of.2.iter().filter_map(|(k, _)| Some(named[*k].as_ref()?.1.clone())).collect();
        let text = |tokens: &Vec<Token>| tokens.iter().map(|token| token.text.as_str()).collect::<String>();
        let next = self.list.len();
        let number = *self.numbers.entry((of.clone(), samplers.iter().map(text).collect())).or_insert(next);
        if number == next {
            self.list.push((of.clone(), samplers));
        }
        Ok(Some((number, of)))
    }

    /// The type and the tokens of the sampler that an argument names.
    fn named(&self, argument: &[Token], chosen: &Chosen) -> Option<(String, Vec<Token>)> {
        let (first, rest) = argument.split_first()?;
        let sampler = match chosen.get(&first.text) {
            Some(sampler) => [sampler, rest].concat(),
            None => argument.to_vec(),
        };
        let (kind, array) = self.samplers.get(&sampler[0].text)?;
        let element = sampler.len() == 4 && number_in_brackets(&sampler[1..]).is_some();
        (sampler.len() == 1 || *array && element).then(|| (kind_of(kind, *array && !element), sampler))
    }

    /// Appends a copy of a function, or of its prototype.
    fn write(&mut self, number: usize, tokens: &[Token], start: usize, of: &Function, out: &mut Vec<Token>) -> TranslateResult {
        let name = &tokens[of.name];
        out.extend_from_slice(&tokens[start..of.name]);
        out.push(Token::new(copy_name(number, &name.text), name.line));
        out.push(tokens[of.name + 1].clone());
        let parameters = parts(&tokens[of.name + 2..of.close]).into_iter().enumerate();
        let others = parameters.filter(|(k, _)| of.likeness.2.iter().all(|(at, _)| at != k)).map(|(_, parameter)| parameter);
        out.extend_from_slice(&others.collect::<Vec<_>>().join(&Token::new(",", name.line)));
        out.push(tokens[of.close].clone());
        let chosen = self.chosen(number, of);
        out.extend(self.replaced(&tokens[of.body.clone()], &chosen)?);
        Ok(())
    }
}

/// The name of a copy.
fn copy_name(number: usize, of: &str) -> String {
    format!("glx_copy{number}_{of}_")
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(text: &str) -> Result<String, Wrong> {
        let mut shaders = [preprocess(text).expect("tokens")];
        specialise(&mut shaders).map(|()| print(&shaders[0].1).split_whitespace().collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn each_call_gets_a_copy_for_its_samplers() {
        let text = "vec4 f(sampler2D s, vec2 p) { return texture2D(s, p); } vec4 g(float k, in lowp sampler2D t) { return k * f(t, vec2(k)); }\n\
            uniform sampler2D a, b[2]; void main() { c = f(a, x) + g(2.0, b[1]) + f(a, f(a, y).xy) + f.f(a); }";
        let wanted = "uniform sampler2D a , b [ 2 ] ; \
            vec4 glx_copy0_f_ ( vec2 p ) { return texture2D ( a , p ) ; } vec4 glx_copy2_f_ ( vec2 p ) { return texture2D ( b [ 1 ] , p ) ; } \
            vec4 glx_copy1_g_ ( float k ) { return k * glx_copy2_f_ ( vec2 ( k ) ) ; } \
            void main ( ) { c = glx_copy0_f_ ( x ) + glx_copy1_g_ ( 2.0 ) + glx_copy0_f_ ( glx_copy0_f_ ( y ) . xy ) + f . f ( a ) ; }";
        assert_eq!(of(text).expect("copies"), wanted);
    }

    #[test]
    fn overloads_are_told_by_the_types_of_samplers() {
        let text = "float f(sampler2D s); float f(samplerCube s); float f(vec2 v) { return v.x; }\nuniform samplerCube c;\n\
            void main() { a = f(c) + f(vec2(1)); } float f(samplerCube s) { return 1.0; }";
        let wanted = "uniform samplerCube c ; float glx_copy0_f_ ( ) ; float f ( vec2 v ) { return v . x ; } \
            void main ( ) { a = glx_copy0_f_ ( ) + f ( vec2 ( 1 ) ) ; } float glx_copy0_f_ ( ) { return 1.0 ; }";
        assert_eq!(of(text).expect("copies"), wanted);
    }

    #[test]
    fn arrays_of_samplers_are_passed_whole_or_by_element() {
        let text = "vec4 f(sampler2D s) { return g(s); } vec4 h(sampler2D s[2], sampler2D[2] t) { return f(s[1]) + g(t[0]); }\n\
            uniform sampler2D b[2]; void main() { c = h(b, b); }";
        let wanted = "uniform sampler2D b [ 2 ] ; vec4 glx_copy1_f_ ( ) { return g ( b [ 1 ] ) ; } \
            vec4 glx_copy0_h_ ( ) { return glx_copy1_f_ ( ) + g ( b [ 0 ] ) ; } void main ( ) { c = glx_copy0_h_ ( ) ; }";
        assert_eq!(of(text).expect("copies"), wanted);
    }

    #[test]
    fn an_argument_that_names_no_sampler_is_refused() {
        for call in ["f(b[i])", "f(c)", "f(b)", "f(b[0][0])"] {
            let text = format!(
                "float f(sampler2D s) {{ return 1.0; }}\nuniform sampler2D b[2]; uniform samplerCube c;\nvoid main() {{ a = {call}; }}"
            );
            assert_eq!(of(&text).expect_err("no sampler").line, 3, "{call}");
        }
    }

    #[test]
    fn copies_have_a_bound() {
        // A function of 2,000 tokens for each of 1,000 choices of samplers.
        let mut text: String = (0..10).map(|k| format!("uniform sampler2D t{k};\n")).collect();
        let body = "x + ".repeat(1000);
        text += &format!("float f0(sampler2D a, sampler2D b, sampler2D c, sampler2D d) {{ return {body} 1.0; }}\n");
        let calls: String = (0..1000).map(|k| format!("y += f0(t{}, t{}, t{}, t0);\n", k % 10, k / 10 % 10, k / 100)).collect();
        text += &format!("void main() {{ {calls} }}");
        let wrong = of(&text).expect_err("two million tokens");
        assert!(wrong.reason.starts_with("more than"), "{}", wrong.reason);
    }
}
