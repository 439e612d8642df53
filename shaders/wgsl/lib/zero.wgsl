// Nought, as the compiler can't know: main sets it to something that is. Mesa's software driver writes uniforms on
// which alone a branch or a loop depends into the shader, and compiles it anew, which takes longer than the pass,
// whenever any uniform changes. What went through `varied` is no uniform to it. A test finds what didn't.
var<private> zero: u32 = 0u;

fn varied(value: u32) -> u32 {
    return value | zero;
}
