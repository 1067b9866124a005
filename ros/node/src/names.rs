//! Topic names with namespaces and remapping, as for ROS 2 nodes (<https://design.ros2.org/articles/topic_and_service_names.html>).

use std::str::FromStr;

use mrfgs::error::Reason;

/// A remapping rule in ROS's syntax `FROM:=TO`. `__ns:=/NAMESPACE` sets the namespace, and `__node:=NAME` the node name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rule {
    from: String,
    to: String,
}

/// Resolves names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// Starts with a slash and ends without one, except for `/`.
    namespace: String,
    node: String,
    /// Full names, before and after remapping.
    rules: Vec<(String, String)>,
}

impl FromStr for Rule {
    type Err = Reason;

    fn from_str(text: &str) -> Result<Self, Reason> {
        match text.split_once(":=") {
            Some((from, to)) if !from.is_empty() && !to.is_empty() => {
                Ok(Self { from: from.into(), to: to.into() })
            }
            _ => Err("give FROM:=TO, such as left/image_raw:=/camera/left/image_raw".into()),
        }
    }
}

impl Names {
    /// The names of a node called `node`, unless a rule renames it.
    ///
    /// # Errors
    /// If a rule contains an invalid name.
    pub fn new(node: &str, rules: &[Rule]) -> Result<Self, Reason> {
        let set = |words: &[&str]| rules.iter().find(|rule| words.contains(&rule.from.as_str()));
        let node = set(&["__node", "__name"]).map_or(node, |rule| &rule.to).to_owned();
        if !is_part(&node) {
            return Err(format!("{node:?} is not a valid node name; use letters, digits and _").into());
        }
        let namespace = set(&["__ns"]).map_or("/", |rule| &rule.to);
        let namespace = format!("/{}", namespace.trim_matches('/'));
        if namespace != "/" {
            check(&namespace)?;
        }
        let mut names = Self { namespace, node, rules: Vec::new() };
        for Rule { from, to } in rules.iter().filter(|rule| !rule.from.starts_with("__")) {
            let rule = (names.full(from)?, names.full(to)?);
            names.rules.push(rule);
        }
        Ok(names)
    }

    /// The name of the node.
    #[must_use]
    pub fn node(&self) -> &str {
        &self.node
    }

    /// The namespace, with leading slash.
    #[must_use]
    pub fn namespace(&self) -> &str {
        &self.namespace
    }

    /// The full name of the topic `name`, remapped.
    ///
    /// # Errors
    /// If it is not a valid name.
    pub fn resolve(&self, name: &str) -> Result<String, Reason> {
        let full = self.full(name)?;
        let rule = self.rules.iter().find(|(from, _)| *from == full);
        Ok(rule.map_or(full, |(_, to)| to.clone()))
    }

    /// Whether a rule remaps the topic `name`.
    #[must_use]
    pub fn remaps(&self, name: &str) -> bool {
        self.full(name).is_ok_and(|full| self.rules.iter().any(|(from, _)| *from == full))
    }

    /// `name` in the namespace, or in the node's own for names that start with `~/`.
    fn full(&self, name: &str) -> Result<String, Reason> {
        let namespace = self.namespace.trim_end_matches('/');
        let full = match name.strip_prefix("~/") {
            Some(own) => format!("{namespace}/{}/{own}", self.node),
            None if name.starts_with('/') => name.to_owned(),
            None => format!("{namespace}/{name}"),
        };
        check(&full)?;
        Ok(full)
    }
}

/// Refuses an invalid full name.
fn check(full: &str) -> Result<(), Reason> {
    let is_name = full.strip_prefix('/').is_some_and(|parts| parts.split('/').all(is_part));
    if is_name {
        return Ok(());
    }
    let reason = format!(
        "{full:?} is not a valid ROS name; between slashes use letters, digits and _, not starting with a digit"
    );
    Err(reason.into())
}

fn is_part(part: &str) -> bool {
    let is_of_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    part.chars().all(is_of_name) && part.chars().next().is_some_and(|first| !first.is_ascii_digit())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(rules: &[&str], name: &str) -> Result<String, String> {
        let rules: Result<Vec<Rule>, Reason> = rules.iter().map(|rule| rule.parse()).collect();
        let names = rules.and_then(|rules| Names::new("mrfgs", &rules));
        names.and_then(|names| names.resolve(name)).map_err(|reason| reason.to_string())
    }

    #[test]
    fn names_are_expanded_and_remapped() {
        for (rules, name, full) in [
            (&[][..], "disparity", "/disparity"),
            (&[], "~/disparity", "/mrfgs/disparity"),
            (&["__ns:=/robot", "__node:=eyes"], "~/disparity", "/robot/eyes/disparity"),
            (&["__ns:=robot/head/"], "left/image_raw", "/robot/head/left/image_raw"),
            (&["__ns:=/robot"], "/disparity", "/disparity"),
            (&["left/image_raw:=/cam0/image_raw"], "left/image_raw", "/cam0/image_raw"),
            (&["left/image_raw:=/cam0/image_raw"], "right/image_raw", "/right/image_raw"),
            // The first rule wins, and its result is not remapped again.
            (&["a:=b", "a:=c", "b:=d"], "a", "/b"),
            (&["__ns:=/x", "/x/a:=b"], "a", "/x/b"),
        ] {
            assert_eq!(resolved(rules, name).as_deref(), Ok(full), "{rules:?} {name}");
        }
        for (rules, name) in [
            (&["a"][..], "a"),
            (&["a:="], "a"),
            (&[":=a"], "a"),
            (&["a:=b c"], "a"),
            (&["a:=b//c"], "a"),
            (&["a:=/"], "a"),
            (&["a:=b/"], "a"),
            (&["a:=0b"], "a"),
            (&["__ns:=/a b"], "a"),
            (&["__node:=a/b"], "a"),
            (&[], ""),
            (&[], "~"),
        ] {
            assert!(resolved(rules, name).is_err(), "{rules:?} {name}");
        }
        let rule: Rule = "a:=b".parse().unwrap();
        let names = Names::new("n", &[rule]).unwrap();
        assert!(names.remaps("/a") && !names.remaps("b"));
    }
}
