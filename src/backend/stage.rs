//! The stages of the method: the one table that lists them, and the exact definition of each.
//!
//! A row gives the variant of [`Stage`] and the name of its files: `cpu/NAME.rs`, `gpu/NAME.rs`, `shaders/NAME.wgsl`, and the
//! twin and the test of that name. Whatever needs a list of all stages follows from [`for_every_stage`](crate::for_every_stage).

use crate::plan::Plan;

/// Calls the macro `$then` with all rows: those that run at a level, those that run on the volumes of level 0, and those that
/// look at maps alone.
#[doc(hidden)]
#[macro_export]
macro_rules! for_every_stage {
    ($then:ident) => {
        $then! {
            levels {
                /// The members of the dependency factors of a level, chosen as `graph` says from the level's guide. The guide
                /// of level 0 is the left image, that of a coarser level [`Image::downsampled`](crate::image::Image::downsampled) of the next finer one.
                Graph graph;
                /// Cost of a level (1 or coarser) from that of the next finer one, in 1/256 cost units (costs of level 0 count
                /// 256 times).
                ///
                /// First x and y: for each fine label the 5 x 5 binomial mean (1 4 6 4 1, outer product) around (2 x, 2 y),
                /// coordinates clamped to the image, rounded as (sum + 128) >> 8. Then d, from those means: for coarse label z, with
                /// low-pass their binomial mean over the fine labels 2 z - 2 ..= 2 z + 2, labels clamped to the fine range, rounded as
                /// (sum + 8) >> 4; with the minimum, the smallest at those labels of 2 z - 1 ..= 2 z + 1 that are in the range.
                Pyramid pyramid;
                /// Costs of a level at labels outside the pixel's label range, become the highest there
                /// is: [`crate::plan::COST_MAX`] (256 times that at coarser levels).
                LabelRange label_range;
                /// The label windows of a level: the labels that each pixel has. The pixels of a run of
                /// [`WINDOW_RUN`](crate::plan::WINDOW_RUN) columns from a multiple of it on, in the rows 2 r and 2 r + 1, share a window.
                /// It holds `count` labels from `first` on, a multiple of [`WINDOW_STEP`](crate::plan::WINDOW_STEP); `count` is
                /// what is needed, rounded up to whole blocks of [`LABEL_BLOCK`](crate::plan::LABEL_BLOCK), and `first` is reduced where
                /// the window would end behind the level's last block.
                ///
                /// - Where the levels join one after the other, and this is not the coarsest: what is needed are the labels 2 c - 2 to 2 c + 2
                ///   for the candidates c of all pixels of the next coarser level that are at most
                ///   [`WINDOW_REACH`](crate::plan::WINDOW_REACH) rows and columns away from the run's: rows r - 2 to r + 2, columns
                ///   4 i - 2 to 4 i + 5 for run i. Candidates are the labels whose belief is at most
                ///   [`WINDOW_SLACK`](crate::plan::WINDOW_SLACK) above the pixel's smallest.
                /// - Otherwise, where zones limit the labels: the label ranges of the run's pixels.
                /// - Otherwise all labels.
                ///
                /// For every stage, the belief of a label outside its pixel's window is infinite: [`VolumeWidth::most`](crate::plan::VolumeWidth::most).
                LabelWindow label_window;
                /// Evidence of a level from its cost by its [`crate::plan::EvidenceScale`] (costs of level 0 count 256 times), within
                /// the label windows alone, and beliefs equal to the evidence.
                Evidence evidence;
                /// Messages of the dependency factors of a level, from the beliefs and their own old messages.
                ///
                /// With q of each member, its belief less the factor's old message to it, infinite where the belief is (and, where
                /// the rule is [`crate::plan::TruncationRule::Absolute`], less its minimum over the labels that the factor's own pixel has
                /// too), the message to a member is s = the sum of q over the other members, at most
                /// [`VolumeWidth::most`](crate::plan::VolumeWidth::most), truncated by [`Plan::dependency`](crate::plan::Plan::dependency) with its bounds for the smallest s
                /// over the labels that the member and the factor's own pixel have. A factor of one member, and a slot without one, keep
                /// the message they have: 0, from the start. Messages at labels that the member does not have are not defined.
                Dependency dependency;
                /// Messages of the resolution factors between a level (1 or coarser) and the next finer one, in both directions,
                /// from the beliefs and their own old messages.
                ///
                /// Each coarse pixel (x, y) has one factor with its children (2 x, 2 y) to (2 x + 1, 2 y + 1), as far as they are
                /// inside. q is the belief less the factor's old message, infinite where the belief is (and less its minimum where the
                /// rule is absolute). Labels d
                /// and z agree when |d - 2 z| is at most 1 (interpolating) or 0 (strict). U\[c\](z) is the smallest q\[c\](d) of
                /// the d that agree with z, infinite if none does. To the parent: s(z) = the sum of U\[c\](z). To child c:
                /// t(z) = q\[p\](z) + the sum of the other children's U(z), and s(d) = the smallest t(z) of the z that agree with d,
                /// infinite if none does. Each s is truncated by [`Plan::resolution`](crate::plan::Plan::resolution) with its bounds for the smallest s over the labels
                /// that the pixel has. Infinite is [`VolumeWidth::most`](crate::plan::VolumeWidth::most), and sums saturate there. Messages at labels that
                /// the pixel does not have are not defined.
                Resolution resolution;
                /// Beliefs of a level: evidence, plus every dependency message to the pixel, plus the resolution messages from
                /// above and from below; at most [`Plan::belief_most`](crate::plan::Plan::belief_most).
                Belief belief;
                /// [`Stage::Dependency`] and then [`Stage::Belief`] of a level.
                Flood flood;
            }
            finest {
                /// Matching cost of level 0, 0 ..= [`crate::plan::COST_MAX`].
                ///
                /// The cost of pixel (x, y) and disparity d compares left (x, y) with right (x - d, y). It is
                /// [`Plan::outside_cost`](crate::plan::Plan::outside_cost) when x - d is outside the image or either pixel is masked. Otherwise:
                /// - SAD: round(S / (768 n)), at most [`crate::plan::COST_MAX`], ties up, where n counts the places (i, j) of the
                ///   window at which left (x + i, y + j) and right (x - d + i, y + j) are both inside and unmasked, and S sums
                ///   |dr| + |dg| + |db| over them.
                /// - Census: 4 min(h, 40), where h bits of the two censuses differ. The census of a pixel has a bit for each other
                ///   place of a 9 x 7 window, set where that place, clamped to the image, is unmasked and its grey is below the
                ///   centre's.
                /// - AD-census: that plus (w min(|dr| + |dg| + |db|, 64) + 32) >> 6, channels in whole 8-bit levels (>> 8), with the
                ///   weight w = floor(48 min(v, t) / t) of the left pixel, 48 where t = [`Plan::colour_variance`](crate::plan::Plan::colour_variance) is 0. Over the same
                ///   window, clamped places again,
                ///   v = 63 sum g^2 - (sum g)^2 with g the grey >> 8, that of the centre where the place is masked.
                Cost cost;
                /// The label map of level 0, and the sum over its pixels of the squared difference from the map of the last
                /// time (of label indices; from 0 the first time). But for the first time, the map has settled where the sum is at
                /// most [`Plan::settled_change`](crate::plan::Plan::settled_change).
                Change change;
                /// [`Map::Label`](super::Map::Label), [`Map::Best`](super::Map::Best) and [`Map::RunnerUp`](super::Map::RunnerUp) of level 0, among the labels
                /// that the pixel has.
                WinnerTakesAll winner_takes_all;
                /// [`Map::RightLabel`](super::Map::RightLabel) and [`Map::RightBest`](super::Map::RightBest): at (x, y) the label with the smallest belief of left pixel (x + d, y) among
                /// those in the columns [`Plan::core`](crate::plan::Plan::core), the lowest on ties, and that belief.
                RightView right_view;
                /// [`Map::Raw`](super::Map::Raw), and [`Map::Disparity`](super::Map::Disparity) equal to it: the label and, where [`crate::options::RefinementOptions::sub_pixel`] asks
                /// for it, its offset.
                ///
                /// The offset is the tip of the symmetric V, the steeper side setting the slope of both, through three sums of
                /// matching cost: a, b and c at the label below, at the label and above, each over those pixels of the 5 x 3
                /// neighbourhood, as far as it is inside, whose own label is at most two away. With s = max(a, c) - b it is
                /// floor((256 (a - c) + s) / (2 s)), clamped to -256 ..= 256, and 0 where s <= 0, at an end of the range, or without a label. (The cost and
                /// not the belief: the truncation of the messages flattens the belief beside its optimum and draws a fit to whole labels. Up to a
                /// whole label: beside a step between labels, messages often leave a pixel on the wrong side of it. More columns
                /// than rows: on the ground, disparities differ from row to row.)
                SubPixel sub_pixel;
                /// The views exchange roles, both mirrored, so that the right view becomes the left one and its matches lie to the
                /// left again. Each image takes the place of the other, and with x counted from the other side
                /// [`Map::Label`](super::Map::Label) and [`Map::Best`](super::Map::Best) those of
                /// [`Map::RightLabel`](super::Map::RightLabel) and [`Map::RightBest`](super::Map::RightBest).
                /// [`Map::RunnerUp`](super::Map::RunnerUp) becomes that of a pixel without one, since none of the right view is known.
                /// [`Stage::Cost`], [`Stage::SubPixel`] and the stages of maps then work on the right view.
                SwapViews swap_views;
                /// [`Map::RightLabel`](super::Map::RightLabel) and [`Map::RightBest`](super::Map::RightBest) become
                /// [`Map::Label`](super::Map::Label) and [`Map::Best`](super::Map::Best), with x counted from the other side: what the match
                /// of the mirrored pair has found. They stay when that of the pair itself is prepared.
                MirrorLabels mirror_labels;
            }
            maps {
                /// [`Map::Validity`](super::Map::Validity): [`flag::MASKED`] alone on pixels masked in the left image, [`flag::OUTSIDE`] on others
                /// without a label. On the rest, where [`crate::options::RefinementOptions::left_right_check`] is not off,
                /// [`flag::OUTSIDE`] where the match is outside the right image and [`flag::OCCLUDED`] where the right pixel's own
                /// label differs by more than one, and otherwise 0.
                ///
                /// [`flag::MASKED`]: crate::maps::flag::MASKED
                /// [`flag::OUTSIDE`]: crate::maps::flag::OUTSIDE
                /// [`flag::OCCLUDED`]: crate::maps::flag::OCCLUDED
                LeftRightCheck left_right_check;
                /// Among the pixels that [`Stage::LeftRightCheck`] left without a flag, those whose runner-up has the belief of the best
                /// label get [`flag::TIE`](crate::maps::flag::TIE). The others form 4-connected regions; labels that differ by at most one
                /// connect. Every pixel of a region of fewer than [`crate::options::RefinementOptions::speckle_size`] pixels gets
                /// [`flag::SPECKLE`](crate::maps::flag::SPECKLE). A tie is in no region, so no pixel gets both. (A tie says that nothing tells the
                /// labels apart, as where an image is overexposed. The best label is then merely the lowest, in regions that may be large.)
                SpeckleFilter speckle_filter;
                /// [`Map::Confidence`](super::Map::Confidence): how far the best runner-up is behind the optimum, in half units (eighths of a nat), at most 255;
                /// 255 where there is no runner-up, 0 for invalid pixels. Sets
                /// [`flag::LOW_CONFIDENCE`](crate::maps::flag::LOW_CONFIDENCE) on valid pixels below
                /// [`crate::options::RefinementOptions::confidence_floor`].
                Confidence confidence;
                /// Fills [`Map::Disparity`](super::Map::Disparity) on every invalid pixel that is not masked with the farther of the nearest valid
                /// disparities to the left and to the right on its row, or the one there is: what is occluded belongs to the
                /// farther surface. The smaller of two is farther, or the larger where [`crate::options::RefinementOptions::nearer`] says so. A row without any valid pixel takes the nearest row that has one, the upper on ties. Sets
                /// [`flag::FILLED`](crate::maps::flag::FILLED). Where no pixel at all is valid, nothing is filled.
                Fill fill;
                /// A disparity by votes on every filled pixel that gets one, and on valid ones that are outvoted, where [`crate::options::RefinementOptions::fill`] asks for
                /// votes; constants are those of [`crate::plan::votes`].
                ///
                /// Half-size pixel (X, Y) stands for the pixels (2 X, 2 Y) to (2 X + 1, 2 Y + 1), as far as they are inside. Its colour is, channel by
                /// channel, floor((2 s + n) / (2 n)), with s the sum of c >> 8 over the n of them that are not masked, and 0 without any. Differences
                /// are sums over the channels. Labels are the even label indices k.
                ///
                /// 1. Own votes v(k), of its pixels: of a valid pixel with disparity D, min(|D - 256 l|, [`VOTE_MOST`](crate::plan::votes::VOTE_MOST)) >>
                ///    [`VOTE_BITS`](crate::plan::votes::VOTE_BITS) with l the disparity of label k in pixels; of a pixel (x, y) that is neither valid nor masked,
                ///    [`VOTE_HIDING`](crate::plan::votes::VOTE_HIDING) where k hides what the right view sees. It sees at (x', y) the nearest label j of those of the sure
                ///    pixels (x' + j, y) (j as a disparity), valid ones with a confidence of at least [`VOTE_SURE`](crate::plan::votes::VOTE_SURE); k hides it if x' = x - k is inside and k is nearer by [`HIDING_LABELS`](crate::plan::votes::HIDING_LABELS) or more. Nearer
                ///    is as [`crate::options::RefinementOptions::nearer`] says. Their sum counts 2 ^ [`VOTE_FRACTION_BITS`](crate::plan::votes::VOTE_FRACTION_BITS) times.
                /// 2. Along the row, with w(X) / 65536 the weight ([`vote_weights`](crate::weights::vote_weights)) of the difference between X - 1 and X: f(X) = v(X) + w(X) f(X - 1), and
                ///    b(X) = w(X + 1) (v(X + 1) + b(X + 1)), each product rounded down; r = (f + b) >> [`VOTE_SHIFT`](crate::plan::votes::VOTE_SHIFT).
                /// 3. Along the column, over at most [`VOTE_REACH`](crate::plan::votes::VOTE_REACH) rows Y' on either side: what comes from there starts as 0 at the farthest, and
                ///    at each step towards Y becomes w (r + itself), rounded down, with r of the row that the step leaves and w the weight of the step.
                ///    The sum s is r of Y plus both.
                /// 4. The vote is for the label with the smallest s, the lowest on ties; there is none where s is the same for all labels. With p and q what
                ///    the s of the labels two below and two above have more, both halved as often as it takes to bring them below 65536 and
                ///    rounded down, and t the larger one, its offset is floor((512 (p - q) + t) / (2 t)), in 1/256 px; 0 where t = 0 or at either end.
                /// 5. A filled pixel (x, y) takes the vote of that half-size pixel with a vote, among the 3 x 3 around (x >> 1, y >> 1) that are inside, whose colour
                ///    differs least from its own (c >> 8), [`VOTE_AWAY`](crate::plan::votes::VOTE_AWAY) added for each column and row away, the first in reading order on ties. Without any it
                ///    keeps what it has. A valid pixel that is not sure is outvoted where half-size pixel (x >> 1, y >> 1) has a vote that is more than
                ///    [`VOTE_OUTVOTES`](crate::plan::votes::VOTE_OUTVOTES) from its disparity. It takes this vote, its flags are [`flag::OUTVOTED`](crate::maps::flag::OUTVOTED) and
                ///    [`flag::FILLED`](crate::maps::flag::FILLED) alone, and its confidence is 0.
                VoteFill vote_fill;
                /// [`Stage::Plane`] on filled pixels alone, or [`Stage::Median`] where [`crate::options::RefinementOptions::plane`] is off,
                /// twice: with places as far apart as either of [`FILL_STEP_BITS`](crate::weights::FILL_STEP_BITS) says. x and y count in places
                /// there, for the weights as well as for the plane. Weights are
                /// [`MedianWeights::of_filled`](crate::weights::MedianWeights::of_filled).
                FillPlane fill_plane;
                /// Weighted median of [`Map::Disparity`](super::Map::Disparity), on the pixels that [`crate::options::RefinementOptions::median`] names and that have a
                /// disparity, over the pixels that have one in the centre's row of the window and in every second row from there: the
                /// smallest value at which half of the weight is reached. Weights are [`crate::weights::MedianWeights`] of the left image.
                Median median;
                /// [`Stage::Median`], and then planes: each pixel that it changes takes the value at its place of a plane
                /// through the disparities of its window, found in two rounds of weighted least squares.
                ///
                /// The plane at (x, y), counted from the pixel, is c + a x + b y above the median, in 1/256 px; a, b and c start at 0. In a
                /// round, each place with x + y / 2 even that has a weight w in the median has e = (its disparity - the plane there) >> k,
                /// m = w (256 - |e|) >> 8, at least 0, and g = m e >> 3. With k = 2 in the first round and 0 in the second
                /// ([`PLANE_BITS`](crate::plan::planes::PLANE_BITS)), a disparity counts up to 4 px and then up to 1 px from the plane. With
                /// \[f\] the sum of f over these places, s = max(\[m\], 1), and all divisions rounded towards 0:
                ///
                /// - The centre is at u = 16 \[m x\] / s and v = 16 \[m y\] / s, with a mean of t = 32 \[g\] / s.
                /// - About it, xx = 16 (\[m x x\] - (\[m x\] u >> 4)) / s + 16, yy = 16 (\[m y y\] - (\[m y\] v >> 4)) / s + 16,
                ///   xy = 16 (\[m x y\] - (\[m x\] v >> 4)) / s, xe = (8 \[g x\] - (\[m x\] t >> 2)) / s and
                ///   ye = (8 \[g y\] - (\[m y\] t >> 2)) / s. (The 16 stand for 1 px^2, which holds slopes that little supports.)
                /// - With n = max(xx yy - xy xy, 1), a grows by (xe yy - ye xy) 2^(k + 4) / n and b by (ye xx - xe xy) 2^(k + 4) / n, but
                ///   not beyond +-[`PLANE_STEEPEST`](crate::plan::planes::PLANE_STEEPEST).
                /// - With da and db by how much they did grow, c grows by (2^(k + 2) t - da u - db v + 8) >> 4, but not beyond
                ///   +-[`PLANE_FARTHEST`](crate::plan::planes::PLANE_FARTHEST).
                ///
                /// The result is clamped to the range of the disparities.
                Plane plane;
            }
        }
    };
}

macro_rules! define {
    (
        levels { $( $(#[$of_level:meta])* $level:ident $level_name:ident; )* }
        finest { $( $(#[$of_finest:meta])* $finest:ident $finest_name:ident; )* }
        maps { $( $(#[$of_map:meta])* $map:ident $map_name:ident; )* }
    ) => {
        /// A stage of the method, with its level where it has one. The documentation of each is its exact definition, which the
        /// CPU path, the shader and the naive twin in the tests follow independently.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Stage {
            $( $(#[$of_level])* $level(usize), )*
            $( $(#[$of_finest])* $finest, )*
            $( $(#[$of_map])* $map, )*
        }

        impl Stage {
            /// Every stage that there is for `plan`, whether its method takes it or not.
            #[must_use]
            pub fn all(plan: &Plan) -> Vec<Self> {
                let of_level = (0..plan.levels.len()).flat_map(|z| [$( Self::$level(z) ),*]);
                let is_there = |stage: &Self| match stage {
                    Self::Pyramid(z) | Self::Resolution(z) => *z > 0,
                    Self::LabelRange(_) => plan.limits_labels(),
                    _ => true,
                };
                of_level.chain([$( Self::$finest, )* $( Self::$map ),*]).filter(is_there).collect()
            }

            /// Its name: that of its files.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $( Self::$level(_) => stringify!($level_name), )*
                    $( Self::$finest => stringify!($finest_name), )*
                    $( Self::$map => stringify!($map_name), )*
                }
            }

            /// The level that it runs at; `None` for what there is at the finest one alone.
            #[must_use]
            pub fn level(self) -> Option<usize> {
                match self {
                    $( Self::$level(z) )|* => Some(z),
                    _ => None,
                }
            }
        }
    };
}

for_every_stage!(define);
