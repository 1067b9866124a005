//! Options of the evidence and the messages of belief propagation.

use super::row::{one_of, options, real, words};

words! {
    /// Potential of a factor whose members disagree, against 1 where they agree.
    Potential {
        /// exp(-truncation), with each message truncated after its minimum is subtracted, so that a factor whose members
        /// disagree still informs them.
        Soft = "soft",
        /// exp(-truncation) exactly: the robust P^n Potts model (Kohli et al. 2007).
        Exact = "exact",
        /// 0. A cap on costs acts only on labels that have no chance.
        Hard = "hard",
    }
}

words! {
    /// Which fine labels d and coarse labels z agree in a resolution factor.
    Agreement {
        /// d = 2 z: an odd label agrees with none.
        Strict = "strict",
        /// |d - 2 z| <= 1: an odd label agrees with both its coarse neighbours.
        Interpolating = "interpolating",
    }
}

options! {
    /// Evidence and messages.
    "messages" MessageOptions {
        /// Cost that makes a label one nat less likely: evidence = cost / temperature.
        temperature: f64 = 0.25, takes real(1e-3..=1e6), unit "cost per nat",
            source "equation 5 read in the logarithmic domain; open";
        /// Largest evidence against a label.
        evidence_cap: f64 = 8.0, takes real(0.25..=63.75), unit "nats", source "not in the paper", for reproduction;
        /// How many times stronger the evidence of a level is than that of the next finer one: it is a mean
        /// over more pixels.
        evidence_gain: f64 = 4.0, takes real(1.0..=4.0), unit "factor per level", source "open", for reproduction;
        /// Potential of factors whose members disagree.
        potential: Potential = Potential::Soft, takes one_of(Potential::WORDS), source "section 2.2: hard", for reproduction;
        /// Cost of disagreement in a dependency factor; hard potentials do not use it.
        dependency_truncation: f64 = 2.0, takes real(0.25..=255.75), unit "nats", source "not in the paper";
        /// Cost of labels that differ by one in a dependency factor of a level coarser than the finest, where a slanted surface has
        /// several labels within a factor; soft potentials alone use it, where it is below that of disagreement.
        label_step: f64 = 0.75, takes real(0.25..=255.75), unit "nats", source "not in the paper";
        /// Which labels of two levels agree.
        agreement: Agreement = Agreement::Interpolating, takes one_of(Agreement::WORDS),
            source "section 2.2; open for odd labels", for reproduction;
        /// Cost of disagreement in a resolution factor; hard potentials do not use it.
        resolution_truncation: f64 = 3.0, takes real(0.25..=255.75), unit "nats", source "not in the paper";
    }
}
