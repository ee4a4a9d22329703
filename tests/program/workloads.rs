//! The recorded speed workloads are byte for byte those on which other renderers were measured.

#[path = "../../examples/record_workloads/mesh.rs"]
mod mesh;

use mesh::Mesh;

/// FNV-1a, 64 bits.
fn fnv1a(parts: &[&[u8]]) -> u64 {
    parts
        .iter()
        .flat_map(|part| part.iter())
        .fold(14_695_981_039_346_656_037, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(1_099_511_628_211))
}

fn hash(mesh: &Mesh) -> u64 {
    fnv1a(&[&mesh.vertex_bytes(), &mesh.index_bytes()])
}

#[test]
fn meshes_have_the_published_hashes() {
    for (name, mesh, vertices, triangles, expected) in [
        ("w1", mesh::w1(), 502_681, 1_002_528, 0xbdde_b02c_e2c5_138e),
        ("w2", mesh::w2(100), 300, 100, 0xaec1_e5db_588d_f49b),
        ("w3", mesh::w3(), 300_000, 100_000, 0xa6f7_6709_e2b7_de8c),
        ("w4", mesh::w4(), 35_000, 70_000, 0xb329_fe5e_89a2_cc73),
    ] {
        assert_eq!((mesh.vertices.len(), mesh.indices.len()), (vertices, 3 * triangles), "{name}");
        // The sines of W4 come from the host's C library; the published hash is that of glibc.
        if name != "w4" || cfg!(target_env = "gnu") {
            assert_eq!(hash(&mesh), expected, "{name}");
        }
    }
}

#[test]
fn textures_have_the_published_hashes() {
    assert_eq!(fnv1a(&[&mesh::texture(1024, 7)]), 0x4b14_9dfe_4b01_c4ed);
    assert_eq!(fnv1a(&[&mesh::texture(512, 5)]), 0x7ee5_145d_d350_9905);
    assert_eq!(mesh::next_level(&mesh::texture(512, 5), 512).len(), 256 * 256 * 4);
    assert_eq!((mesh::WIDTH, mesh::HEIGHT, mesh::w4_camera()[11]), (1920, 1080, -1.0));
}
