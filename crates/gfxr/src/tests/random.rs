//! Random blocks by the table.

use crate::decode::{TEMPLATE, template_groups};
use crate::layout::{CallLayout, Field, Kind, StructLayout, layout};
use crate::*;

/// True if other values can follow a structure. The data of an update template go to the end.
pub fn chainable(of: &StructLayout) -> bool {
    of.fields.iter().all(|field| field.kind != Kind::Template)
}

/// A generator of numbers (SplitMix64).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    pub fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    fn text(&mut self) -> String {
        (0..self.below(12)).map(|_| ['a', 'B', '_', 'ä', '√', '𝄞'][self.below(6) as usize]).collect()
    }

    /// Bytes that compress and bytes that do not.
    fn bytes(&mut self) -> Vec<u8> {
        let few = self.below(2) == 0;
        (0..self.below(300)).map(|_| if few { self.below(2) as u8 } else { self.next() as u8 }).collect()
    }

    /// A call with random values. None if it cannot be without a union whose form is not known.
    pub fn call(&mut self, of: &CallLayout) -> Option<Call> {
        let parameters = self.fields(&of.parameters, 0)?;
        let result = of.result.as_ref().map(|kind| self.value(kind, 0).expect("a number"));
        Some(Call { number: of.number, name: of.name, parameters, result })
    }

    pub fn structure(&mut self, of: &'static StructLayout, depth: u32) -> Option<Struct> {
        let mut members = self.fields(&of.fields, depth + 1)?;
        if let (Some(tag), Some((_, Value::Enum(kind)))) = (of.tag, members.first_mut()) {
            kind.value = tag.cast_signed();
        }
        Some(Struct { name: of.name, members })
    }

    fn fields(&mut self, of: &[Field], depth: u32) -> Option<Vec<(&'static str, Value)>> {
        let mut members: Vec<(&'static str, Value)> = Vec::new();
        for (place, field) in of.iter().enumerate() {
            let value = match (&field.kind, of.get(place + 1).map(|next| &next.kind)) {
                (Kind::Enum(kind), Some(Kind::Union(_))) => Value::Enum(Enum {
                    kind,
                    value: self.below(3) as i32 + if *kind == "VkPerformanceValueTypeINTEL" { 2 } else { 0 },
                }),
                (Kind::Union(union), _) => self.union(union, &members, depth)?,
                (kind, _) => self.value(kind, depth)?,
            };
            members.push((field.name, value));
        }
        Some(members)
    }

    fn union(&mut self, union: &str, before: &[(&'static str, Value)], depth: u32) -> Option<Value> {
        let selector = before.iter().find(|(name, _)| matches!(*name, "type" | "geometryType"))?.1.i32().ok()?;
        let structure = match (union, selector) {
            ("VkPerformanceValueDataINTEL", 4) => return Some(Value::Str(self.text())),
            ("VkPerformanceValueDataINTEL", _) => return Some(Value::U64(self.next())),
            ("VkAccelerationStructureGeometryDataKHR", kind) => decode::geometry(kind),
            ("VkAccelerationStructureMotionInstanceDataNV", kind) => decode::motion(kind),
            _ => None,
        };
        Some(Value::Struct(self.structure(layout().structure(structure?)?, depth)?))
    }

    fn value(&mut self, kind: &Kind, depth: u32) -> Option<Value> {
        let bits = self.next();
        Some(match kind {
            Kind::U8 => Value::U8(bits as u8),
            Kind::U16 => Value::U16(bits as u16),
            Kind::U32 => Value::U32(bits as u32),
            Kind::I32 => Value::I32(bits as i32),
            Kind::U64 => Value::U64(bits),
            Kind::I64 => Value::I64(bits as i64),
            Kind::F32 => Value::F32(f32::from_bits(bits as u32)),
            Kind::F64 => Value::F64(f64::from_bits(bits)),
            Kind::Handle => Value::Handle(bits),
            Kind::Enum(kind) => Value::Enum(Enum { kind, value: bits as i32 }),
            Kind::Struct(place) => Value::Struct(self.structure(&layout().structs[*place], depth)?),
            Kind::Union(_) => return None,
            Kind::Pointer(_) | Kind::Array(_) | Kind::Str | Kind::WideStr | Kind::Next | Kind::Template
                if self.below(6) == 0 || depth > 4 =>
            {
                if self.below(3) == 0 {
                    Value::Omitted(if *kind == Kind::Next { 1 } else { self.below(9) })
                } else {
                    Value::Null
                }
            }
            Kind::Str | Kind::WideStr => Value::Str(self.text()),
            Kind::Next => {
                let chained: Vec<_> = layout().structs.iter().filter(|of| of.tag.is_some() && chainable(of)).collect();
                let of = chained[self.below(chained.len() as u64) as usize];
                self.structure(of, depth).map_or(Value::Null, Value::Struct)
            }
            Kind::Pointer(inner)
                if self.below(8) > 0 || matches!(**inner, Kind::Struct(of) if !chainable(&layout().structs[of])) =>
            {
                self.value(inner, depth).unwrap_or(Value::Null)
            }
            Kind::Pointer(inner) | Kind::Array(inner) => match **inner {
                Kind::U8 => Value::Bytes(self.bytes()),
                Kind::U32 => Value::Words((0..self.below(80)).map(|_| self.next() as u32).collect()),
                _ => (0..self.below(4))
                    .map(|_| self.value(inner, depth))
                    .collect::<Option<_>>()
                    .map_or(Value::Null, Value::Array),
            },
            Kind::Template => {
                let mut members = Vec::new();
                for (name, of) in template_groups() {
                    let element =
                        |_| of.map_or_else(|| Some(Value::Handle(bits)), |of| self.structure(of, depth).map(Value::Struct));
                    members.push((name, Value::Array((0..bits % 3).map(element).collect::<Option<_>>()?)));
                }
                members
                    .push(("accelerationStructures", Value::Array((0..self.below(3)).map(|_| Value::Handle(bits)).collect())));
                members.push(("inlineUniformBlocks", Value::Bytes(self.bytes())));
                Value::Struct(Struct { name: TEMPLATE, members })
            }
        })
    }

    /// A block of any kind.
    pub fn body(&mut self) -> Body {
        let (a, b, c) = (self.next(), self.next(), self.next());
        let marker = if a % 2 == 0 { Marker::Begin } else { Marker::End };
        match self.below(40) {
            0 => Body::UnknownCall { number: a as u32 | 1 << 31, data: self.bytes() },
            1..=3 => Body::FillMemory { memory: a, offset: b, data: self.bytes() },
            4 => Body::InitBuffer { device: a, buffer: b, data: self.bytes() },
            5 => {
                let levels = (0..self.below(4)).map(|_| self.next()).collect();
                Body::InitImage { device: a, image: b, aspect: c as u32, layout: a as u32, levels, data: self.bytes() }
            }
            6 => Body::ResizeWindow { surface: a, width: b as u32, height: c as u32, rotation: (a % 2 == 0).then_some(3) },
            7 => {
                let image = |random: &mut Self| SwapchainImage {
                    image: random.next(),
                    index: a as u32,
                    layout: b as u32,
                    acquired: random.below(2) == 0,
                    device_mask: c as u32,
                    semaphore: random.next(),
                    fence: random.next(),
                    queue: random.next(),
                };
                let images = (0..self.below(4)).map(|_| image(self)).collect();
                Body::SwapchainImages { device: a, swapchain: b, last_presented: c as u32, images }
            }
            8 => Body::BeginResources { device: a, size: b, largest_copy: c },
            9 => Body::EndResources { device: a },
            10 => Body::DeviceProperties(DeviceProperties {
                physical_device: a,
                api_version: b as u32,
                driver_version: c as u32,
                vendor: self.next() as u32,
                device: self.next() as u32,
                device_type: self.next() as u32,
                cache_uuid: [a as u8; 16],
                name: self.text(),
            }),
            11 => Body::MemoryProperties {
                physical_device: a,
                types: (0..self.below(4)).map(|_| (b as u32, c as u32)).collect(),
                heaps: (0..self.below(4)).map(|_| (b, c as u32)).collect(),
            },
            12 => Body::OpaqueAddress { device: a, object: b, address: c },
            13 => Body::ExeFile(ExeFile {
                application: self.text(),
                version: [a as u32; 4],
                product: self.text(),
                ..ExeFile::default()
            }),
            14 => Body::Driver(self.text()),
            15 => Body::Frame { marker, number: b },
            16 => Body::State { marker, number: b },
            17 => Body::Annotation { form: a as u32, label: self.text(), text: self.text() },
            18 => Body::Message(self.text()),
            19 => Body::Other {
                kind: 3,
                meta: Some(1 << 16 | 34),
                name: "ExecuteBlocksFromFile",
                compressed: a % 2 == 0,
                data: self.bytes(),
            },
            20 => Body::Other { kind: 77, meta: None, name: "", compressed: a % 2 == 0, data: self.bytes() },
            _ => {
                let calls: Vec<_> = call_names().filter_map(|name| layout().call_of_name(name)).collect();
                loop {
                    let of = calls[self.below(calls.len() as u64) as usize];
                    if let Some(call) = self.call(of) {
                        return Body::Call(call);
                    }
                }
            }
        }
    }
}
