// Regions are found by union-find (after Playne and Hawick 2018): every pixel of a region points at a smaller place of it
// until it points at the root, which points at itself. First each row's segments get their runs, then the segments of
// a row are joined, then ever higher blocks of rows; in between all pointers are made to lead straight to their
// roots. What is joined in one go are two blocks along one border, so a chain never gets longer than that border has
// pixels on its two sides: this bounds the loops.
//
// Places count from the first row of the rows seen, the band and as many rows around it as a region may be high
// before it is large enough.

const SEGMENT: u32 = 64u;
// A pixel that is in no region.
const NOWHERE: u32 = 0xffffffffu;
