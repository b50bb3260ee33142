// Heights to lines of equal height, as wide everywhere in samples.
// In: a slot of fused heights. Out: a slot of one colour, its coverage the line's: from the distance to the
// nearest line, which is the difference of height over the gradient. Flat ground has no lines.
// CPU twin: cpu/isolines.rs.

#import shared::slot
#import shared::colour

struct Isolines {
    spacing_m: f32,
    // In samples.
    half_width: f32,
    bold_half_width: f32,
    // Each how-manieth line is bold; 0: none.
    bold_every: u32,
    colour: vec4<f32>,
}

@group(0) @binding(0) var<uniform> parameters: Isolines;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    let word = textureLoad(input_0, id.xy, 0).x;
    let change = differences(input_0, vec2<i32>(id.xy), word);
    let gradient = sqrt(change.x * change.x + change.y * change.y);
    let here = bitcast<f32>(select(word, 0u, word == INVALID));
    let spacing = parameters.spacing_m;
    let line = round(here / spacing);
    let flat_below = 1e-6 * spacing;
    let distance = abs(here - line * spacing) / max(gradient, flat_below);
    let every = f32(parameters.bold_every);
    let bold = every > 0.0 && round(line / max(every, 1.0)) * every == line;
    let half_width = select(parameters.half_width, parameters.bold_half_width, bold);
    // How much of a sample's width lies in the line: no more than the line is wide.
    let most = min(2.0 * half_width, 1.0);
    let coverage = min(max(half_width + 0.5 - distance, 0.0), most);
    let none = word == INVALID || gradient < flat_below;
    textureStore(result, id.xy, vec4<u32>(select(pack_colour(parameters.colour.rgb, coverage), 0u, none)));
}
