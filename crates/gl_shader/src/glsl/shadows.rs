//! Parameters and local variables with the names of global samplers. Samplers are replaced by their names, so these get others.

use std::collections::BTreeSet;

use super::outline::{Variables, items};
use super::sampler::sampler;
use super::tokens::{Dialect, Token};

/// Words after which a name is no declaration.
const NO_TYPES: [&str; 8] = ["return", "else", "do", "case", "in", "out", "inout", "const"];

/// Renames them in all shaders of a stage.
pub fn shadows(shaders: &mut [(Dialect, Vec<Token>)]) {
    let mut samplers = BTreeSet::new();
    for (_, tokens) in shaders.iter() {
        for item in items(tokens).into_iter().filter(|item| item.function.is_none()) {
            let of = Variables::of(&tokens[item.whole]).filter(|of| of.has("uniform") && sampler(&of.kind[0].text).is_some());
            samplers.extend(of.into_iter().flat_map(|of| of.names).map(|name| name[0].text.clone()));
        }
    }
    if samplers.is_empty() {
        return;
    }
    for (_, tokens) in shaders {
        for item in items(tokens) {
            let Some(header) = item.function else { continue };
            // Names that are hidden, and how many blocks are open where they are declared.
            let (mut hidden, mut blocks): (Vec<(String, u32)>, u32) = (Vec::new(), 0);
            for at in header.open..item.whole.end {
                match tokens[at].text.as_str() {
                    "{" => blocks += 1,
                    "}" => {
                        blocks = blocks.saturating_sub(1);
                        hidden.retain(|&(_, depth)| depth <= blocks);
                    }
                    name if samplers.contains(name) && !tokens[at - 1].is(".") => {
                        let kind = &tokens[at - 1];
                        let is_kind = kind.word && !NO_TYPES.contains(&kind.text.as_str()) && sampler(&kind.text).is_none();
                        let known = hidden.iter().any(|(known, _)| known == name);
                        if is_kind && !known {
                            hidden.push((name.to_owned(), blocks));
                        }
                        if is_kind || known {
                            tokens[at].text = format!("glx_local_{name}_");
                        }
                    }
                    _ => {}
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    #[test]
    fn a_local_name_hides_a_sampler_to_the_end_of_its_block() {
        let text = "uniform sampler2D t, s; vec4 f(vec4 t) { return g(t) + g(s); } \
            void main() { { vec4 t = g(t.t); f(t); } f(g(t)); } float h(sampler2D t) { return g(t); }";
        let mut shaders = [preprocess(text).expect("tokens")];
        shadows(&mut shaders);
        assert_eq!(
            print(&shaders[0].1).split_whitespace().collect::<Vec<_>>().join(" "),
            "uniform sampler2D t , s ; vec4 f ( vec4 glx_local_t_ ) { return g ( glx_local_t_ ) + g ( s ) ; } \
             void main ( ) { { vec4 glx_local_t_ = g ( glx_local_t_ . t ) ; f ( glx_local_t_ ) ; } f ( g ( t ) ) ; } \
             float h ( sampler2D t ) { return g ( t ) ; }"
        );
    }
}
