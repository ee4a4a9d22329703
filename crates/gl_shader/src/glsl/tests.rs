//! The text for naga of small shaders.

use host::with_room_for;

use super::TranslateResult;
use super::rewrite::rewrite;
use super::tokens::preprocess;
use crate::arb::program::ProgramStage;

/// The words of the shaders of a fragment stage as naga gets them, without what stands before the first shader.
fn lowered(texts: &[&str]) -> TranslateResult<String> {
    let texts = texts.iter().map(|text| preprocess(text)).collect::<TranslateResult<Vec<_>>>()?;
    let text = with_room_for(4096, || rewrite(ProgramStage::Fragment, texts)).expect("a thread")?.text;
    let shaders = text.lines().skip(2).flat_map(str::split_whitespace);
    Ok(shaders.collect::<Vec<_>>().join(" "))
}

#[track_caller]
fn gives(text: &str, wanted: &str) {
    assert_eq!(lowered(&[text]).as_deref(), Ok(wanted), "{text}");
}

/// Lowers statements of `main` after declarations; the declarations stay as they are.
#[track_caller]
fn gives_in(head: &str, body: &str, wanted: &str) {
    let wanted = format!("{head} void main ( ) {{ {wanted} }}");
    gives(&format!("{head} void main() {{ {body} }}"), wanted.trim_start());
}

#[track_caller]
fn refused(texts: &[&str], line: u32, reason: &str) {
    let wrong = lowered(texts).expect_err(texts[0]);
    assert!(wrong.line == line && wrong.reason.contains(reason), "{texts:?}: {wrong:?}");
}

#[test]
fn all_forms_are_read_and_printed() {
    for text in [
        "struct S { float x [ 2 ] ; vec2 y ; } s , t [ 2 ] ; const float k [ 2 ] = float [ 2 ] ( 1.0 , 2.0 ) ;",
        "float f ( in float x , inout vec2 y [ 2 ] ) { return x ; }",
        "void f ( ) { for ( int i = 0 , j = 1 ; i < 2 ; i ++ , j -- ) { if ( a ) continue ; else break ; } for ( ; ; ) ; }",
        "void f ( ) { while ( a ) { b ; } while ( c ) ; do { e ; } while ( ! g ) ; { discard ; } }",
        "#version 130\nvoid f ( ) { switch ( a ) { case 1 : case - 2 : b ; break ; default : break ; } return ; }",
        "void f ( ) { a = b ? ( c , d ) : e ? f : g , h += i = j , - - k ; }",
        "void f ( ) { ( a + b ) * c - ( d - e ) << f & ~ g ^ h | i ; ( a && b ^^ c || d ) == ! ( e <= f ) ; }",
        "void f ( ) { a [ 1 ] [ b , c ] . d . e ( f ) ++ ; ( a , b ) . c ; float [ 2 ] a = { 1.0 , 2.0 } ; }",
        "void f ( ) { if ( a ) { if ( b ) c ; } else d ; if ( a ) b ; else if ( c ) d ; }",
    ] {
        gives(text, text.trim_start_matches("#version 130\n"));
    }
    // Brackets that change nothing are left out, and `precision` with what it says.
    gives(
        "precision highp float; lowp float f() { return (((a) * (b)) + c[(1)]); }",
        "float f ( ) { return a * b + c [ 1 ] ; }",
    );
    // The inner `if` does not take the `else`.
    gives("void f() { if (a) for (;;) if (b) c; }", "void f ( ) { if ( a ) for ( ; ; ) if ( b ) c ; }");
}

#[test]
fn words_that_later_versions_reserve_are_names() {
    gives(
        "float sample, flat; float buffer(float texture2D) { flat = texture2D; sample.patch = 1.0; return flat; }",
        "float sample_ , flat_ ; float buffer_ ( float texture2D_ ) { flat_ = texture2D_ ; sample_ . patch_ = 1.0 ; return flat_ ; }",
    );
    gives("#version 130\nflat in int sample; void f() { sample; }", "int sample_ ; void f ( ) { sample_ ; }");
}

#[test]
fn damaged_shaders_are_refused_with_their_lines() {
    for (text, line, reason) in [
        ("void main() {\n a = 1\n}", 3, "`;` is expected, not `}`"),
        ("void main() { a = ;\n}", 1, "an expression is expected, not `;`"),
        ("void main() {\n", 1, "`}` is expected, not the end of the shader"),
        ("(1)\nvoid main() {}", 1, "a type is expected, not `(`"),
        ("float a[2;", 1, "`]` is expected, not `;`"),
        ("float a, = 1.0;", 1, "a name is expected, not `=`"),
        ("void f(float a b) {}", 1, "`,` or `)` is expected, not `b`"),
        ("\nstruct S { float", 2, "a name is expected, not the end of the shader"),
        ("layout( float a;", 1, "`,` or `)` is expected, not `a`"),
        ("void f() { if a; }", 1, "`(` is expected, not `a`"),
        ("void f() { x.; }", 1, "a member is expected, not `;`"),
        ("void f() { g(a; }", 1, "`,` or `)` is expected, not `;`"),
        ("uniform B { float a; } b", 1, "`;` is expected, not the end of the shader"),
        ("void f() {} }", 1, "a type is expected, not `}`"),
    ] {
        refused(&[text], line, reason);
    }
    refused(&["float a;\n\n", "\nfloat = 1.0;"], 3, "a name is expected, not `=`");
}

#[test]
fn a_variable_after_an_array_gets_its_own_declaration() {
    for (text, wanted) in [
        ("float a, b[2], c = 1.0;", "float a ; float b [ 2 ] ; float c = 1.0 ;"),
        ("struct S { float a[2], b; };", "struct S { float a [ 2 ] ; float b ; } ;"),
        ("struct S { float x; } a[2], b;", "struct S { float x ; } a [ 2 ] ; S b ;"),
        ("float a, b[2]; float[2] c, d;", "float a , b [ 2 ] ; float [ 2 ] c , d ;"),
        ("void f() { const lowp S a[2], b; c[1], d; }", "void f ( ) { const S a [ 2 ] ; const S b ; c [ 1 ] , d ; }"),
    ] {
        gives(text, wanted);
    }
}

#[test]
fn arrays_get_their_sizes() {
    for (text, wanted) in [
        ("const vec2 a[] = vec2[](vec2(1, 2), b);", "const vec2 a [ 2 ] = vec2 [ 2 ] ( vec2 ( 1 , 2 ) , b ) ;"),
        ("float[] a = float[3](1, 2, 3);", "float a [ 3 ] = float [ 3 ] ( 1 , 2 , 3 ) ;"),
        ("uniform float a[]; void f() { a[3]; a[1]; }", "float a [ 4 ] ; void f ( ) { a [ 3 ] ; a [ 1 ] ; }"),
        ("void f() { float a[]; a[0]; float a[5]; }", "void f ( ) { float a [ 5 ] ; a [ 0 ] ; }"),
        ("void f() { float a[]; float a[] = float[](1, 2); }", "void f ( ) { float a [ 2 ] ; a = float [ 2 ] ( 1 , 2 ) ; }"),
        ("float a[]; float a[] = float[](1, 2);", "float a [ 2 ] = float [ 2 ] ( 1 , 2 ) ;"),
        ("void f() { float a[]; a[1]; { float a[5]; } }", "void f ( ) { float a [ 2 ] ; a [ 1 ] ; { float a [ 5 ] ; } }"),
    ] {
        gives(text, wanted);
    }
    // One of several objects has the size.
    assert_eq!(lowered(&["float a[];", "float a[3];"]).as_deref(), Ok("float a [ 3 ] ;"));
}

#[test]
fn a_function_whose_end_can_be_reached_returns_there() {
    for (body, end) in [
        ("for ( ; ; ) if ( a ) return b ; else return c ;", "return vec4 ( 0 ) ; "),
        ("do return b ; while ( a ) ;", "return vec4 ( 0 ) ; "),
        ("for ( ; ; ) ; return b ;", ""),
        ("if ( a ) return b ; else { for ( ; ; ) ; }", "return vec4 ( 0 ) ; "),
        ("if ( a ) return b ; else { return c ; }", ""),
        ("if ( a ) return b ; else if ( c ) return d ;", "return vec4 ( 0 ) ; "),
        ("discard ;", "return vec4 ( 0 ) ; "),
    ] {
        gives(&format!("vec4 f() {{ {body} }}"), &format!("vec4 f ( ) {{ {body} {end}}}"));
    }
    gives(
        "struct S { float x; }; S f() { if (a) return b; } highp float[2] g() { } void h() { while (a) b; }",
        "struct S { float x ; } ; S f ( ) { if ( a ) return b ; { S glx_none ; return glx_none ; } } \
         float [ 2 ] g ( ) { { float [ 2 ] glx_none ; return glx_none ; } } void h ( ) { while ( a ) b ; }",
    );
}

#[test]
fn what_never_runs_is_removed() {
    for (body, kept) in [
        ("a; return; b; { c; } for (;;) d;", "a ; return ;"),
        ("if (a) { return; b; } c;", "if ( a ) { return ; } c ;"),
        (
            "for (;;) { if (a) break; else continue; do { b; } while (c); } d;",
            "for ( ; ; ) { if ( a ) break ; else continue ; } d ;",
        ),
        ("{ discard; } a;", "{ discard ; }"),
        (
            "switch (a) { case 0: return; b; case 1: c; break; d; default: { return; } break; } e;",
            "switch ( a ) { case 0 : if ( true ) { return ; } break ; case 1 : c ; break ; \
             default : if ( true ) { { return ; } break ; } break ; } e ;",
        ),
        ("if (a) if (b) return; else return; c;", "if ( a ) if ( b ) return ; else return ; c ;"),
        ("if (a) return; else { b; return; } c[1] = d(e);", "if ( a ) return ; else { b ; return ; }"),
    ] {
        gives(&format!("#version 130\nvoid main() {{ {body} }}"), &format!("void main ( ) {{ {kept} }}"));
    }
}

#[test]
fn a_case_that_goes_on_has_what_it_goes_on_with() {
    for (body, wanted) in [
        (
            "switch (a) { case 0: b; case 1: case 2: { c; } default: d; break; case 3: e; }",
            "switch ( a ) { case 0 : b ; { c ; } d ; break ; case 1 : case 2 : { c ; } d ; break ; default : d ; break ; case 3 : e ; break ; }",
        ),
        // The inner `switch` is written first.
        (
            "switch (a) { case 0: switch (b) { case 1: c; case 2: d; } case 3: e; break; }",
            "switch ( a ) { case 0 : switch ( b ) { case 1 : c ; d ; break ; case 2 : d ; break ; } e ; break ; case 3 : e ; break ; }",
        ),
        // A case that returns ends with `break`, too.
        (
            "switch (a) { case 0: return; case 1: b; case 2: { discard; } break; default: return; }",
            "switch ( a ) { case 0 : if ( true ) { return ; } break ; case 1 : b ; if ( true ) { { discard ; } break ; } break ; \
             case 2 : if ( true ) { { discard ; } break ; } break ; default : if ( true ) { return ; } break ; }",
        ),
        (
            "switch (a) { case 0: b; break; case 1: if (c) return; d; break; default: return; }",
            "switch ( a ) { case 0 : b ; break ; case 1 : if ( c ) return ; d ; break ; default : return ; }",
        ),
        ("switch (a) { }", "switch ( a ) { }"),
    ] {
        gives(&format!("#version 130\nvoid main() {{ {body} }}"), &format!("void main ( ) {{ {wanted} }}"));
    }
    let all: String = (0..1000).map(|k| format!("case {k}: a(b, c, d);")).collect();
    refused(&[&format!("#version 130\nvoid f() {{\nswitch (a) {{ {all} }} }}")], 3, "more than 262144 tokens of cases");
}

#[test]
fn continue_goes_on_with_the_condition() {
    for (body, wanted) in [
        (
            "do { if (a) continue; do b; while (b); } while (c(d)); e;",
            "{ bool glx_again2 = false ; while ( glx_again2 ? c ( d ) : ( glx_again2 = true ) ) \
             { if ( a ) continue ; do b ; while ( b ) ; } } e ;",
        ),
        // The loop inside has it.
        ("do { for (;;) { continue; } } while (a);", "do { for ( ; ; ) { continue ; } } while ( a ) ;"),
        ("while (a) { do b; while (c); continue; }", "while ( a ) { do b ; while ( c ) ; continue ; }"),
    ] {
        gives_in("", body, wanted);
    }
}

#[test]
fn a_declaration_that_is_a_body_gets_a_block() {
    gives_in(
        "",
        "if (a) int i = 1; else float i; do int i = g(), j; while (i < 2); for (int k;;) if (b) { int i; }",
        "if ( a ) { int i = 1 ; } else { float i ; } do { int i = g ( ) , j ; } while ( i < 2 ) ; \
         for ( int k ; ; ) if ( b ) { int i ; }",
    );
}

#[test]
fn right_sides_with_effects_become_branches() {
    let head = "bool f ( ) { return true ; } bool g ( ) { return true ; }";
    for (text, wanted) in [
        ("a = b && f();", "a = b ? f ( ) : false ;"),
        ("a = b || i++ > 1;", "a = b ? true : i ++ > 1 ;"),
        ("if (a && b && f()) x;", "if ( a && b ? f ( ) : false ) x ;"),
        ("if (a && f() && g()) x;", "if ( ( a ? f ( ) : false ) ? g ( ) : false ) x ;"),
        ("a || b && f();", "a ? true : b ? f ( ) : false ;"),
        ("a && b || f() && c || d;", "( a && b ? true : f ( ) && c ) || d ;"),
        ("a ^^ b && f() ^^ c || f();", "a ^^ ( b ? f ( ) : false ) ^^ c ? true : f ( ) ;"),
        ("x ? a && f() : b || (c = d);", "x ? a ? f ( ) : false : b ? true : ( c = d ) ;"),
        ("h(a && f(), v[int(b || f())]);", "h ( a ? f ( ) : false , v [ int ( b ? true : f ( ) ) ] ) ;"),
    ] {
        gives_in(head, text, wanted);
    }
    for text in ["a && b || c == d ;", "f ( ) && a ;", "a && sin ( b ) > 0.5 ;", "x = a <= b && c ;"] {
        gives_in(head, text, text);
    }
}

#[test]
fn components_of_written_components_are_named_at_once() {
    let head = "struct S { vec4 xy ; } ; S s ; vec4 v , w [ 2 ] ; mat3 m ;";
    for (text, wanted) in [
        ("v.xzy.z = 1;", "v . y = 1 ;"),
        ("v.bgr.yx.x += w[1].xyz.zyx.x;", "v . y += w [ 1 ] . xyz . zyx . x ;"),
        ("v.wzyx[2] = 1; v.wzyx[i] = 1; v[2] = 1;", "v . y = 1 ; v . wzyx [ i ] = 1 ; v [ 2 ] = 1 ;"),
        ("s.xy.x = 1; v.yx.x == 1; s.xy.zy.y++;", "s . xy . x = 1 ; v . yx . x == 1 ; s . xy . y ++ ;"),
        ("m[1].x = 1; m[i].zy.y -= 1; w[0].a *= 2;", "m [ 1 ] [ 0 ] = 1 ; m [ i ] [ 1 ] -= 1 ; w [ 0 ] [ 3 ] *= 2 ;"),
    ] {
        gives_in(head, text, wanted);
    }
}

#[test]
fn arrays_and_structures_are_compared_by_functions() {
    let head = "struct T { float t [ 2 ] ; } ; struct S { vec2 v ; T t ; } ;";
    let array = "bool glx_equal ( float a [ 2 ] , float b [ 2 ] ) { for ( int i = 0 ; i < 2 ; i ++ ) \
        { if ( ! ( a [ i ] == b [ i ] ) ) { return false ; } } return true ; }";
    let parts = "bool glx_equal ( T a , T b ) { for ( int i = 0 ; i < 2 ; i ++ ) { if ( ! ( a . t [ i ] == b . t [ i ] ) ) { return false ; } } return true ; }";
    let whole = "bool glx_equal ( S a , S b ) { if ( ! ( a . v == b . v ) ) { return false ; } \
        if ( ! glx_equal ( a . t , b . t ) ) { return false ; } return true ; }";
    for (text, functions, wanted) in [
        (
            "S f(S p) { if (p == f(s[1]) && s[i].t != (p.t) || p.v == s[0].v) { } return p; }",
            format!("{parts} {whole} "),
            "S f ( S p ) { if ( glx_equal ( p , f ( s [ 1 ] ) ) && ! glx_equal ( s [ i ] . t , p . t ) || p . v == s [ 0 ] . v ) { } return p ; }",
        ),
        (
            "void f(T a, T b) { if (a.t != b.t) { } }",
            String::new(),
            "void f ( T a , T b ) { if ( ! ( a . t [ 0 ] == b . t [ 0 ] && a . t [ 1 ] == b . t [ 1 ] ) ) { } }",
        ),
        (
            "void f() { float a[2], b = a[1]; if (a == float[](1.0, b) && b == a[0]) { } }",
            format!("{array} "),
            "void f ( ) { float a [ 2 ] ; float b = a [ 1 ] ; if ( glx_equal ( a , float [ 2 ] ( 1.0 , b ) ) && b == a [ 0 ] ) { } }",
        ),
        // Two variables of one name and two types.
        (
            "void f() { { float a[2]; a == a; } { float a; a == a; } }",
            format!("{array} "),
            "void f ( ) { { float a [ 2 ] ; glx_equal ( a , a ) ; } { float a ; a == a ; } }",
        ),
    ] {
        gives(&format!("{head} uniform S s[2]; {text}"), &format!("{head} S s [ 2 ] ; {functions}{wanted}"));
    }
    // A structure in itself, which naga refuses, ends.
    assert!(lowered(&["struct S { S s; }; void f() { S a; a == a; }"]).is_ok());
}

#[test]
fn initialisers_that_are_no_constants_move_to_main() {
    let one = "uniform float u = 1.0; const float k = 2.0; float a = k * 0.5, b[2] = float[2](u, 1.0), c;\n\
         struct S { float x; } s = S(u); void f() {}";
    let two = "float d = sin(k); vec2 e = vec2(1).yx; const mat2 m = outerProduct(e, e); void f(); void main() { float u; f(); } float g = a;";
    let wanted = "float u = 1.0 ; const float k = 2.0 ; float a = k * 0.5 ; float b [ 2 ] ; float c ; struct S { float x ; } s ; \
         float d ; vec2 e ; mat2 m ; float g ; void f ( ) { } void main ( ) { b = float [ 2 ] ( u , 1.0 ) ; s = S ( u ) ; d = sin ( k ) ; \
         e = vec2 ( 1 ) . yx ; m = glx_outerProduct ( e , e ) ; g = a ; float u ; f ( ) ; }";
    assert_eq!(lowered(&[one, two]).as_deref(), Ok(wanted));
    let texts = [one, two].map(|text| preprocess(text).expect("tokens")).into();
    let source = rewrite(ProgramStage::Fragment, texts).expect("a text");
    assert_eq!(source.initialised.into_iter().collect::<Vec<_>>(), ["a", "k", "u"]);
}

#[test]
fn a_local_name_hides_a_sampler_to_the_end_of_its_block() {
    gives(
        "uniform sampler2D t, s; vec4 f(vec4 t) { return g(t); } \
         void main() { { vec4 t = texture2D(t, p).t; f(t); } f(texture2D(t, p)); }",
        "vec4 f ( vec4 glx_local_t_ ) { return g ( glx_local_t_ ) ; } \
         void main ( ) { { vec4 glx_local_t_ = glx_Plain_tx ( p ) . t ; f ( glx_local_t_ ) ; } f ( glx_Plain_tx ( p ) ) ; }",
    );
}

#[test]
fn each_call_gets_a_copy_for_its_samplers() {
    gives(
        "vec4 f(sampler2D s, vec2 p) { return texture2D(s, p); } vec4 g(float k, in lowp sampler2D t) { return k * f(t, vec2(k)); }\n\
         uniform sampler2D a, b[2]; void main() { c = f(a, x) + g(2.0, b[1]) + f(a, f(a, y).xy) + f.f; }",
        "vec4 glx_copy0_f_ ( vec2 p ) { return glx_Plain_ax ( p ) ; } vec4 glx_copy2_f_ ( vec2 p ) { return glx_Plain_b_at1_x ( p ) ; } \
         vec4 glx_copy1_g_ ( float k ) { return k * glx_copy2_f_ ( vec2 ( k ) ) ; } \
         void main ( ) { c = glx_copy0_f_ ( x ) + glx_copy1_g_ ( 2.0 ) + glx_copy0_f_ ( glx_copy0_f_ ( y ) . xy ) + f . f ; }",
    );
    // Overloads differ in the types of their samplers.
    gives(
        "float f(sampler2D s); float f(samplerCube s); float f(vec2 v) { return v.x; }\nuniform samplerCube c;\n\
         void main() { a = f(c) + f(vec2(1)); } float f(samplerCube s) { return 1.0; }",
        "float f ( vec2 v ) { return v . x ; } float glx_copy0_f_ ( ) { return 1.0 ; } \
         void main ( ) { a = glx_copy0_f_ ( ) + f ( vec2 ( 1 ) ) ; }",
    );
    gives(
        "float f(sampler2D s, vec2 t) { return 1.0; } float f(sampler2D s, sampler2D t) { return 2.0; }\n\
         uniform sampler2D a; void main() { f(a, a); f(a, b); }",
        "float glx_copy1_f_ ( vec2 t ) { return 1.0 ; } float glx_copy0_f_ ( ) { return 2.0 ; } \
         void main ( ) { glx_copy0_f_ ( ) ; glx_copy1_f_ ( b ) ; }",
    );
    // Arrays of samplers are passed whole or by element.
    gives(
        "vec4 f(sampler2D s) { return texture2D(s, x); } vec4 h(sampler2D s[2], sampler2D[2] t) { return f(s[1]) + f(t[0]); }\n\
         uniform sampler2D b[2]; void main() { c = h(b, b); }",
        "vec4 glx_copy1_f_ ( ) { return glx_Plain_b_at1_x ( x ) ; } vec4 glx_copy2_f_ ( ) { return glx_Plain_b_at0_x ( x ) ; } \
         vec4 glx_copy0_h_ ( ) { return glx_copy1_f_ ( ) + glx_copy2_f_ ( ) ; } void main ( ) { c = glx_copy0_h_ ( ) ; }",
    );
    for call in ["f(b[i])", "f(c)", "f(b)", "f(b[0][0])"] {
        let text = format!(
            "float f(sampler2D s) {{ return 1.0; }}\nuniform sampler2D b[2]; uniform samplerCube c;\nvoid main() {{ a = {call}; }}"
        );
        refused(&[&text], 3, "whose samplers are not those of its parameters");
    }
    // A function of 2,000 tokens for each of 1,000 choices of samplers.
    let mut text: String = (0..10).map(|k| format!("uniform sampler2D t{k};\n")).collect();
    let body = "x + ".repeat(1000);
    text += &format!("float f0(sampler2D a, sampler2D b, sampler2D c, sampler2D d) {{ return {body} 1.0; }}\n");
    let calls: String = (0..1000).map(|k| format!("y += f0(t{}, t{}, t{}, t0);\n", k % 10, k / 10 % 10, k / 100)).collect();
    text += &format!("void main() {{ {calls} }}");
    refused(&[&text], 11, "more than 262144 tokens of functions");
}

#[test]
fn functions_follow_those_that_they_call() {
    let text = "float f(float x); float g(float x) { return f(x); } void main() { g(1.0); } float k;\n\
        float h(float x); float f(float x) { return h(x); } float h(float x) { return k; }";
    let wanted = "float k ; float h ( float x ) { return k ; } float f ( float x ) { return h ( x ) ; } \
        float g ( float x ) { return f ( x ) ; } void main ( ) { g ( 1.0 ) ; }";
    gives(text, wanted);
    // Overloads of another number of parameters are others.
    gives(
        "float g(float x) { return x; } float f(float x, float y) { return g(x); } float f(float x); void f() { f(1.0, 2.0); }",
        "float g ( float x ) { return x ; } float f ( float x , float y ) { return g ( x ) ; } void f ( ) { f ( 1.0 , 2.0 ) ; }",
    );
    refused(&["float f(float x);\nfloat g() { return f(1.0); }"], 1, "the function f has no body");
    // Overloads that call each other keep their order.
    let text = "float f(vec2 x); float f(int x); void main() { f(1.0); } float f(float x) { return f(vec2(x)); } float f(vec2 x) { return f(1); } \
        float f(int x) { return 1.0; }";
    let wanted = "float f ( float x ) { return f ( vec2 ( x ) ) ; } float f ( vec2 x ) { return f ( 1 ) ; } \
        float f ( int x ) { return 1.0 ; } void main ( ) { f ( 1.0 ) ; }";
    gives(text, wanted);
    // A circle ends.
    assert!(lowered(&["void g(); void f() { g(); } void g() { f(); }"]).is_ok_and(|text| text.contains("void g ( )")));
}

#[test]
fn built_in_functions_are_called_where_no_other_is_declared() {
    let one = "float g(float x) { return abs(x); } float abs(float x) { return x; } void main() { abs(1.0); }";
    let two = "float h(float x) { return abs(x); }";
    let wanted = "float glx_own_abs_ ( float x ) { return x ; } float g ( float x ) { return abs ( x ) ; } \
        void main ( ) { glx_own_abs_ ( 1.0 ) ; } float h ( float x ) { return abs ( x ) ; }";
    assert_eq!(lowered(&[one, two]).as_deref(), Ok(wanted));
    let plain = "float abs(float x); void main() { abs(1.0); } float abs(float x) { return x; }";
    gives(plain, "float abs ( float x ) { return x ; } void main ( ) { abs ( 1.0 ) ; }");
}

#[test]
fn a_variable_of_two_objects_is_one() {
    let one = "struct S { float x; }; float a, b; uniform float u; const int n = 1; void f() { a = b; }";
    let two = "struct S { float x; } s; float b = 1.0, c; uniform float u; const int n = 1; void f(); void main() { f(); }";
    let wanted = "struct S { float x ; } ; float a ; float u ; const int n = 1 ; S s ; float b = 1.0 , c ; \
        void f ( ) { a = b ; } void main ( ) { f ( ) ; }";
    assert_eq!(lowered(&[one, two]).as_deref(), Ok(wanted));
    for (one, two) in [
        ("float a;", "\nvec2 a;"),
        ("float a = 1.0;", "\nfloat a = 2.0;"),
        ("const float a = 1.0;", "\nfloat a;"),
        ("float a;", "\nuniform float a;"),
        ("struct S { float x; };", "\nstruct S { vec2 x; };"),
    ] {
        refused(&[one, two], 3, "in different ways");
    }
}

#[test]
fn elements_of_an_array_of_samplers_have_locations_in_order() {
    for (first, wanted) in [(4, [Some(4), Some(5)]), (u32::MAX, [Some(u32::MAX), None])] {
        let text = format!("#version 430\nlayout(location = {first}) uniform sampler2D t[2];");
        let source = rewrite(ProgramStage::Fragment, vec![preprocess(&text).expect("tokens")]).expect("a text");
        assert_eq!(source.samplers.iter().map(|sampler| sampler.location).collect::<Vec<_>>(), wanted);
    }
}
