// Several colours to one, by priority, weight and opacity.
// In: up to 8 slots of colours, lowest first. Out: one slot of colours, a hole where no input covers: means
// within groups of equal priority, each laid over those below it. CPU twin: cpu/fuse_colour.rs.

#import shared::slot
#import shared::colour
#import shared::fusion

@group(0) @binding(0) var<uniform> parameters: Fuse;
@group(0) @binding(1) var result: texture_storage_2d<r32uint, write>;
@group(0) @binding(2) var input_0: texture_2d<u32>;
@group(0) @binding(3) var input_1: texture_2d<u32>;
@group(0) @binding(4) var input_2: texture_2d<u32>;
@group(0) @binding(5) var input_3: texture_2d<u32>;
@group(0) @binding(6) var input_4: texture_2d<u32>;
@group(0) @binding(7) var input_5: texture_2d<u32>;
@group(0) @binding(8) var input_6: texture_2d<u32>;
@group(0) @binding(9) var input_7: texture_2d<u32>;

// What lies below, and the sums over the group at hand. The group's alpha is the mean of alphas by the same
// shares as the mean of colours, so an input that fades away leaves no step.
struct State {
    below: vec3<f32>,
    below_alpha: f32,
    colours: vec3<f32>,
    shares: f32,
    alphas: f32,
}

fn blend_codes(below: vec3<f32>, above: vec3<f32>, blend: u32) -> vec3<f32> {
    let normal_or_add = select(above, min(below + above, vec3<f32>(1.0)), blend == ADD);
    let or_screen = select(normal_or_add, below + above - below * above, blend == SCREEN);
    return select(or_screen, below * above, blend == MULTIPLY);
}

// Lays the group over what is below (W3C Compositing and Blending Level 1, §5 and §9.1.4) and empties it.
fn finish_group(state: State, blend: u32) -> State {
    let alpha = state.alphas / max(state.shares, 1e-30);
    let colour = state.colours / max(state.shares, 1e-30);
    let covered = alpha + state.below_alpha * (1.0 - alpha);
    let sum = alpha * (1.0 - state.below_alpha) * colour
        + alpha * state.below_alpha * blend_codes(state.below, colour, blend)
        + (1.0 - alpha) * state.below_alpha * state.below;
    let empty = state.shares <= 0.0;
    return State(
        select(sum / max(covered, 1e-30), state.below, empty),
        select(covered, state.below_alpha, empty),
        vec3<f32>(0.0), 0.0, 0.0,
    );
}

// Adds input `index` to its group, after the group before it is finished.
fn take(before: State, index: u32, word: u32) -> State {
    let input = parameters.inputs[index];
    let last = parameters.inputs[max(index, 1u) - 1u];
    var state = before;
    if input.group != last.group { state = finish_group(before, last.blend); }
    let colour = unpack_colour(word);
    let alpha = input.opacity * colour.a;
    let share = input.weight * alpha;
    state.colours += share * colour.rgb;
    state.shares += share;
    state.alphas += share * alpha;
    return state;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= SLOT_SIDE || id.y >= SLOT_SIDE { return; }
    var state = State(vec3<f32>(0.0), 0.0, vec3<f32>(0.0), 0.0, 0.0);
    if parameters.count > 0u { state = take(state, 0u, textureLoad(input_0, id.xy, 0).x); }
    if parameters.count > 1u { state = take(state, 1u, textureLoad(input_1, id.xy, 0).x); }
    if parameters.count > 2u { state = take(state, 2u, textureLoad(input_2, id.xy, 0).x); }
    if parameters.count > 3u { state = take(state, 3u, textureLoad(input_3, id.xy, 0).x); }
    if parameters.count > 4u { state = take(state, 4u, textureLoad(input_4, id.xy, 0).x); }
    if parameters.count > 5u { state = take(state, 5u, textureLoad(input_5, id.xy, 0).x); }
    if parameters.count > 6u { state = take(state, 6u, textureLoad(input_6, id.xy, 0).x); }
    if parameters.count > 7u { state = take(state, 7u, textureLoad(input_7, id.xy, 0).x); }
    state = finish_group(state, parameters.inputs[clamp(parameters.count, 1u, 8u) - 1u].blend);
    textureStore(result, id.xy, vec4<u32>(pack_colour(state.below, state.below_alpha)));
}
