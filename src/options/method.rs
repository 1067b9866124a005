//! All groups together.

use serde::{Deserialize, Serialize};

use super::cost::CostOptions;
use super::front::FrontOptions;
use super::graph::GraphOptions;
use super::messages::MessageOptions;
use super::refinement::RefinementOptions;
use super::row::Group;
use super::schedule::ScheduleOptions;
use super::tiles::TileOptions;
use crate::error::{Error, OptionError, Result};

/// All options that determine the maps of a given pair and range.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Method {
    /// Illumination, texture zones, label ranges.
    pub front: FrontOptions,
    /// Matching cost and its pyramid.
    pub cost: CostOptions,
    /// Levels, and members of dependency factors.
    pub graph: GraphOptions,
    /// Evidence and messages.
    pub messages: MessageOptions,
    /// Order and number of iterations.
    pub schedule: ScheduleOptions,
    /// Post-processing of the disparity map.
    pub refinement: RefinementOptions,
    /// Matching in tiles.
    pub tiles: TileOptions,
}

/// Every group of options in a [`Method`], in order.
pub const GROUPS: &[Group] = &[
    FrontOptions::GROUP,
    CostOptions::GROUP,
    GraphOptions::GROUP,
    MessageOptions::GROUP,
    ScheduleOptions::GROUP,
    RefinementOptions::GROUP,
    TileOptions::GROUP,
];

impl Method {
    /// All values, as a table for each group with a value for each key.
    ///
    /// # Panics
    /// Never: every field is a plain value.
    #[cfg(feature = "files")]
    #[must_use]
    pub fn table(&self) -> toml::Table {
        toml::Table::try_from(self).expect("plain values serialise")
    }

    /// This method, if every value is in its range.
    ///
    /// # Errors
    /// [`Error::Option`] naming the first key that is out of its range, and the range.
    pub fn validated(self) -> Result<Self> {
        self.check().map_err(|(key, cause)| Error::option(key, cause))?;
        Ok(self)
    }

    /// Finds the first key that is out of its range.
    pub(super) fn check(&self) -> Result<(), (String, OptionError)> {
        self.front.check_each()?;
        self.cost.check_each()?;
        self.graph.check_each()?;
        self.messages.check_each()?;
        self.schedule.check_each()?;
        self.refinement.check_each()?;
        self.tiles.check_each()?;
        self.cost.check()
    }
}

#[cfg(test)]
mod tests {
    use super::super::row::Key;
    use super::*;

    #[test]
    fn rows_describe_the_fields() {
        let table = Method::default().table();
        assert_eq!(table.len(), GROUPS.len());
        for group in GROUPS {
            let values = table[group.name].as_table().unwrap();
            assert_eq!(values.len(), group.keys.len(), "{}", group.name);
            assert!(group.keys.iter().all(|key| values.contains_key(&key.name())), "{}", group.name);
        }
    }

    #[test]
    fn a_name_means_one_thing() {
        let mut names: Vec<_> = GROUPS.iter().map(|group| group.name.to_owned()).collect();
        names.extend(GROUPS.iter().flat_map(|group| group.keys).map(Key::name));
        names.sort();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
    }

    #[test]
    fn values_out_of_range_are_refused() {
        let change = |change: fn(&mut Method)| {
            let mut method = Method::default();
            change(&mut method);
            method.validated().unwrap_err().to_string()
        };
        assert_eq!(change(|m| m.cost.sad_window = 33), "sad-window: 33 is outside 1 to 31");
        assert_eq!(change(|m| m.cost.sad_window = 8), "sad-window: 8 is not odd; take 7 or 9");
        assert_eq!(change(|m| m.graph.percentile = -0.5), "percentile: -0.5 is outside 0 to 100");
        assert_eq!(
            change(|m| m.messages.temperature = f64::NAN),
            "temperature: NaN is outside 0.001 to 1000000"
        );
        assert_eq!(change(|m| m.cost.outside_cost = 2.0), "outside-cost: 2 is outside 0 to 1.625");
        assert_eq!(change(|m| m.cost.outside_cost = 255.0), "outside-cost: 255 is outside 0 to 254");
    }
}
