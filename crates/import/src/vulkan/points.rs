//! Points larger than a pixel: each becomes a square of four vertices, which is an instance. What advanced with the vertex advances with the
//! instance then, and the place in the point goes to the fragment stage as a varying.

use naga::proc::Emitter;
use naga::{
    Arena, BinaryOperator, Binding, BuiltIn, EntryPoint, Expression, FunctionArgument, Handle, Interpolation, Literal, Module,
    Sampling, Scalar, ScalarKind, Span, Statement, StructMember, Type, TypeInner, VectorSize,
};

use super::shaders::Form;

/// The text of a module whose points are squares, if the form asks for it.
pub fn rewritten(words: &[u32], form: &Form) -> Result<Option<String>, String> {
    if form.points.is_none() && form.point_coord.is_none() {
        return Ok(None);
    }
    let options =
        naga::front::spv::Options { adjust_coordinate_space: false, strict_capabilities: true, block_ctx_dump_prefix: None };
    let parsed = host::guarded(|| {
        naga::front::spv::Frontend::new(words.iter().copied(), &options).parse().map_err(|error| error.to_string())
    });
    let mut module = parsed.and_then(|parsed| parsed)?;
    let location = form.point_coord.unwrap_or(0);
    match form.points {
        Some(size) => expand(&mut module, size.map(f32::from_bits), location)?,
        None => read_coordinates(&mut module, location),
    }
    ron::to_string(&module).map(Some).map_err(|error| error.to_string())
}

fn read(words: &[u32]) -> Result<Module, String> {
    let options =
        naga::front::spv::Options { adjust_coordinate_space: false, strict_capabilities: true, block_ctx_dump_prefix: None };
    let parsed = host::guarded(|| {
        naga::front::spv::Frontend::new(words.iter().copied(), &options).parse().map_err(|error| error.to_string())
    });
    parsed.and_then(|parsed| parsed)
}

/// Whether a vertex stage writes the size of points.
pub fn writes_size(words: &[u32]) -> bool {
    let is_size = |member: &StructMember| member.binding == Some(Binding::BuiltIn(BuiltIn::PointSize));
    read(words).is_ok_and(|module| {
        let results = module.entry_points.iter().filter_map(|entry| entry.function.result.as_ref());
        results.into_iter().any(|result| match &module.types[result.ty].inner {
            TypeInner::Struct { members, .. } => members.iter().any(is_size),
            _ => false,
        })
    })
}

fn varying(location: u32) -> Binding {
    Binding::Location {
        location,
        interpolation: Some(Interpolation::Perspective),
        sampling: Some(Sampling::Center),
        blend_src: None,
        per_primitive: false,
    }
}

/// The fragment stage reads the place in the point from a varying.
fn read_coordinates(module: &mut Module, location: u32) {
    for argument in module.entry_points.iter_mut().flat_map(|entry| &mut entry.function.arguments) {
        if argument.binding == Some(Binding::BuiltIn(BuiltIn::PointCoord)) {
            argument.binding = Some(varying(location));
        }
    }
}

/// Adds expressions to a function, and emits those that must be.
struct Code<'a> {
    expressions: &'a mut Arena<Expression>,
}

impl Code<'_> {
    fn add(&mut self, expression: Expression) -> Handle<Expression> {
        self.expressions.append(expression, Span::UNDEFINED)
    }

    fn float(&mut self, value: f32) -> Handle<Expression> {
        self.add(Expression::Literal(Literal::F32(value)))
    }

    fn binary(&mut self, op: BinaryOperator, left: Handle<Expression>, right: Handle<Expression>) -> Handle<Expression> {
        self.add(Expression::Binary { op, left, right })
    }
}

/// The vertex stage makes the corners of a square from each point.
fn expand(module: &mut Module, [width, height]: [f32; 2], location: u32) -> Result<(), String> {
    let scalar = |inner| Type { name: None, inner };
    let word = module.types.insert(scalar(TypeInner::Scalar(Scalar::U32)), Span::UNDEFINED);
    let pair = TypeInner::Vector { size: VectorSize::Bi, scalar: Scalar::F32 };
    let pair = module.types.insert(scalar(pair), Span::UNDEFINED);
    let four = TypeInner::Vector { size: VectorSize::Quad, scalar: Scalar::F32 };
    let four = module.types.insert(scalar(four), Span::UNDEFINED);
    let [entry] = module.entry_points.as_mut_slice() else { return Err("a module without one entry point".into()) };
    let EntryPoint { function, .. } = entry;
    for argument in &mut function.arguments {
        argument.binding = match argument.binding.take() {
            Some(Binding::BuiltIn(BuiltIn::VertexIndex)) => Some(Binding::BuiltIn(BuiltIn::InstanceIndex)),
            Some(Binding::BuiltIn(BuiltIn::BaseVertex)) => Some(Binding::BuiltIn(BuiltIn::BaseInstance)),
            // Points are drawn in one instance. Its number is 0, as is that of the draw.
            Some(Binding::BuiltIn(BuiltIn::InstanceIndex)) => Some(Binding::BuiltIn(BuiltIn::DrawIndex)),
            other => other,
        };
    }
    let result = function.result.as_mut().ok_or("a vertex stage without results")?;
    let TypeInner::Struct { members, span } = &module.types[result.ty].inner else {
        return Err("a vertex stage with one result".into());
    };
    let find = |wanted: fn(&BuiltIn) -> bool| {
        let is = |member: &StructMember| matches!(&member.binding, Some(Binding::BuiltIn(own)) if wanted(own));
        members.iter().position(is).map(|at| at as u32).ok_or("a vertex stage without position or size")
    };
    let position = find(|own| matches!(own, BuiltIn::Position { .. }))?;
    let size = find(|own| matches!(own, BuiltIn::PointSize))?;
    let mut members = members.clone();
    let (count, offset) = (members.len() as u32, span.next_multiple_of(16));
    members.push(StructMember { name: None, ty: pair, binding: Some(varying(location)), offset });
    let inner = TypeInner::Struct { members, span: offset + 16 };
    result.ty = module.types.insert(Type { name: None, inner }, Span::UNDEFINED);
    let (ty, corner_argument) = (result.ty, function.arguments.len() as u32);
    let binding = Some(Binding::BuiltIn(BuiltIn::VertexIndex));
    function.arguments.push(FunctionArgument { name: None, ty: word, binding });

    let last = function.body.iter().rposition(|statement| matches!(statement, Statement::Return { .. }));
    let Some((last, Some(Statement::Return { value: Some(value) }))) = last.map(|last| (last, function.body.get(last))) else {
        return Err("a vertex stage that does not end with its results".into());
    };
    let value = *value;
    let mut code = Code { expressions: &mut function.expressions };
    let vertex = code.add(Expression::FunctionArgument(corner_argument));
    let one = code.add(Expression::Literal(Literal::U32(1)));
    let [half, minus_half, unit] = [0.5, -0.5, 1.0].map(|value| code.float(value));
    let [width, height] = [width, height].map(|value| code.float(value.max(1.0)));
    let (mut emitter, mut emitted) = (Emitter::default(), Vec::new());
    emitter.start(code.expressions);
    let as_float = |expr| Expression::As { expr, kind: ScalarKind::Float, convert: Some(4) };
    let right = code.binary(BinaryOperator::And, vertex, one);
    let up = code.binary(BinaryOperator::ShiftRight, vertex, one);
    let [right, up] = [right, up].map(|bit| code.add(as_float(bit)));
    // From -1/2 to 1/2, upward, in points; and from 0 to 1, downward.
    let [x, y] = [right, up].map(|side| code.binary(BinaryOperator::Add, side, minus_half));
    let down = code.binary(BinaryOperator::Subtract, unit, up);
    let place = code.add(Expression::Compose { ty: pair, components: vec![right, down] });
    let own = |code: &mut Code<'_>, base, index| code.add(Expression::AccessIndex { base, index });
    let clip = own(&mut code, value, position);
    let size = own(&mut code, value, size);
    let [px, py, pz, pw] = [0, 1, 2, 3].map(|index| own(&mut code, clip, index));
    // A pixel is two parts of the viewport's size in clip space.
    let scaled = code.binary(BinaryOperator::Multiply, size, pw);
    let doubled = code.binary(BinaryOperator::Divide, scaled, half);
    let mut moved = [px, py];
    for (axis, (side, extent)) in [(x, width), (y, height)].into_iter().enumerate() {
        let part = code.binary(BinaryOperator::Multiply, side, doubled);
        let part = code.binary(BinaryOperator::Divide, part, extent);
        moved[axis] = code.binary(BinaryOperator::Add, moved[axis], part);
    }
    let moved = code.add(Expression::Compose { ty: four, components: vec![moved[0], moved[1], pz, pw] });
    let components = (0..count).map(|at| if at == position { moved } else { own(&mut code, value, at) });
    let components: Vec<_> = components.collect();
    let components = components.into_iter().chain([place]).collect();
    let composed = code.add(Expression::Compose { ty, components });
    emitted.extend(emitter.finish(code.expressions));
    let mut body = std::mem::take(&mut function.body);
    let end = Statement::Return { value: Some(composed) };
    let mut tail = naga::Block::new();
    for (statement, span) in emitted.into_iter().chain([(end, Span::UNDEFINED)]) {
        tail.push(statement, span);
    }
    body.splice(last..=last, tail);
    function.body = body;
    Ok(())
}
