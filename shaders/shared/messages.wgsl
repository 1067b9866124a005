// Messages and beliefs in 8 or 16 bits.

#import volume

// For messages and beliefs: labels per word, words per quad of labels, and the largest value (infinity).
const PER_WORD: u32 = 32u / BITS;
const QUAD_WORDS: u32 = 4u / PER_WORD;
const MOST: u32 = 0xffffffffu >> (32u - BITS);

// The value of a label in its word.
fn pick(word: u32, label: u32) -> u32 {
    return (word >> (BITS * (label % PER_WORD))) & MOST;
}

// Offset of the word of a label from the first word of its pixel, in volumes of messages and beliefs of a
// level of this width.
fn word_of(label: u32, width: u32) -> u32 {
    return QUAD_WORDS * (label / 4u) * width + (label % 4u) / PER_WORD;
}
