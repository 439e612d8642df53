// Always 0, but not provably so: main sets it from an expression that is. Where a branch or loop depends only on
// uniforms, Mesa's software driver inlines them into the shader and recompiles it, which takes longer than the pass,
// whenever any uniform changes. It doesn't treat a value passed through `varied` as uniform. A test finds the others.
var<private> zero: u32 = 0u;

fn varied(value: u32) -> u32 {
    return value | zero;
}
