//! One iteration within a level: [`dependency`](super::dependency), and then
//! [`belief`](super::belief).
//!
//! (They are one stage so that a belief can be summed while its messages are at hand; the values
//! are those of the two stages in turn.)

use super::{Data, Descriptor, Volume, volumes};

pub(super) const ROW: Descriptor = Descriptor {
    reads: |z| {
        let messages = [Volume::Dependency(z), Volume::Down(z), Volume::Up(z)].map(Data::Volume);
        let summands = [Volume::Belief(z), Volume::Evidence(z)].map(Data::Volume);
        let graph = [Data::Members(z), Data::Incoming(z), Data::Windows(z)];
        summands.into_iter().chain(messages).chain(graph).collect()
    },
    writes: |z| volumes(&[Volume::Dependency(z), Volume::Belief(z)]),
    joins: true,
    cell: 0.9,
    ..Descriptor::NONE
};
