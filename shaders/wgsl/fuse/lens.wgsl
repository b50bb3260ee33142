// One result outside a circle on the planet, another inside.
// In: two slots of any one kind, outside and inside. Out: for each node the word of its side: inside where
// the circle's polynomial in the tile's lattice is 0 or less. CPU twin: cpu/lens.rs.

#import shared::slot

struct Lens {
    degree: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
    // The coefficient of x^n · y^m is number m · (degree + 1) + n.
    coefficients: array<vec4<f32>, 21>,
}

@group(0) @binding(0) var<uniform> parameters: Lens;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;
@group(0) @binding(3) var input_1: texture_2d<u32>;

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    // The stored lattice is −1…1 both ways.
    let x = f32(i32(id.x) - 137) / 137.0;
    let y = f32(i32(id.y) - 137) / 137.0;
    // Horner's scheme in x within Horner's scheme in y, from the last coefficient to the first.
    let terms = min(parameters.degree, 8u) + 1u;
    var index = terms * terms;
    var value = 0.0;
    for (var m = 0u; m < terms; m++) {
        var row = 0.0;
        for (var n = 0u; n < terms; n++) {
            index -= 1u;
            row = row * x + parameters.coefficients[index / 4u][index % 4u];
        }
        value = value * y + row;
    }
    let outside = textureLoad(input_0, id.xy, 0).x;
    let inside = textureLoad(input_1, id.xy, 0).x;
    textureStore(result, id.xy, vec4<u32>(select(outside, inside, value <= 0.0)));
}
