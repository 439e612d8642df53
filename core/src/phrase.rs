//! Sentences as templates with values, so that what the program says in English can be said in another language.
//!
//! A table of templates has their English text; a phrase is a template with its values, which may be phrases themselves.

use std::fmt;

/// A sentence with places for values: `sum {sum}, {change} from the baseline`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Template {
    /// Its name: unique in its table, in capitals.
    pub name: &'static str,
    /// Its English text.
    pub english: &'static str,
}

/// A table of templates: a constant for each, and `ALL`.
macro_rules! templates {
    ($($name:ident = $english:literal;)*) => {
        $(pub(super) const $name: &$crate::phrase::Template =
            &$crate::phrase::Template { name: stringify!($name), english: $english };)*

        /// All of them.
        pub static ALL: &[&$crate::phrase::Template] = &[$($name),*];
    };
}
pub(crate) use templates;

/// A template with its values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Phrase {
    /// The template.
    pub template: &'static Template,
    /// The values by name: those of the template, each once.
    pub values: Vec<(&'static str, Value)>,
}

/// What stands at a place of a template.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// The same in every language: a name, a date, a key.
    Text(String),
    /// A number, formatted in English.
    Number(String),
    /// Phrases, one after another.
    Phrases {
        /// What stands before the first, where there is one.
        before: &'static str,
        /// What stands between two.
        between: &'static str,
        /// The phrases.
        all: Vec<Phrase>,
    },
}

impl Value {
    /// Phrases with `between` between two.
    pub fn joined(between: &'static str, all: Vec<Phrase>) -> Self {
        Self::Phrases { before: "", between, all }
    }

    /// A phrase with `before` before it, or nothing.
    pub fn after(before: &'static str, phrase: Option<Phrase>) -> Self {
        Self::Phrases { before, between: "", all: phrase.into_iter().collect() }
    }

    /// A number that was formatted in English.
    pub fn number(english: impl fmt::Display) -> Self {
        Self::Number(english.to_string())
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<Phrase> for Value {
    fn from(phrase: Phrase) -> Self {
        Self::joined("", vec![phrase])
    }
}

impl From<&'static Template> for Phrase {
    fn from(template: &'static Template) -> Self {
        Self { template, values: Vec::new() }
    }
}

/// How a language says templates and numbers.
pub trait Say {
    /// The sentence of a template with its values.
    fn template(&self, template: &Template, values: &[(&str, String)]) -> String;

    /// A number that was formatted in English.
    fn number(&self, english: &str) -> String {
        english.to_owned()
    }
}

struct English;

impl Say for English {
    fn template(&self, template: &Template, values: &[(&str, String)]) -> String {
        template.in_english(values)
    }
}

/// The pieces of a template's text, and whether each is the name of a place.
fn pieces(text: &str) -> impl Iterator<Item = (bool, &str)> {
    text.split('{').enumerate().flat_map(|(k, part)| match part.split_once('}') {
        Some((name, rest)) if k > 0 => [(true, name), (false, rest)],
        _ => [(false, part), (false, "")],
    })
}

impl Template {
    /// It with values.
    pub fn with<const N: usize>(&'static self, values: [(&'static str, Value); N]) -> Phrase {
        Phrase { template: self, values: values.into() }
    }

    /// Its English text with values in words.
    pub fn in_english(&self, values: &[(&str, String)]) -> String {
        let mut text = String::new();
        for (is_place, piece) in pieces(self.english) {
            let value = values.iter().find(|(name, _)| is_place && *name == piece);
            text += value.map_or(piece, |(_, value)| value);
        }
        text
    }

    /// Its name as a key: `sum-gone` of `SUM_GONE`.
    pub fn key(&self) -> String {
        self.name.to_lowercase().replace('_', "-")
    }

    /// The names of its places, in order.
    pub fn places(&self) -> impl Iterator<Item = &'static str> {
        pieces(self.english).filter(|(is_place, _)| *is_place).map(|(_, name)| name)
    }
}

impl Phrase {
    /// In a language.
    pub fn say(&self, language: &impl Say) -> String {
        let values: Vec<(&str, String)> = self
            .values
            .iter()
            .map(|(name, value)| {
                let text = match value {
                    Value::Text(text) => text.clone(),
                    Value::Number(english) => language.number(english),
                    Value::Phrases { before, between, all } => {
                        let said: Vec<String> = all.iter().map(|phrase| phrase.say(language)).collect();
                        if said.is_empty() {
                            String::new()
                        } else {
                            format!("{before}{}", said.join(between))
                        }
                    }
                };
                (*name, text)
            })
            .collect();
        language.template(self.template, &values)
    }

    /// Whether it and all phrases in it have the values that their templates have places for.
    pub fn is_whole(&self) -> bool {
        let [mut places, mut names] = [
            self.template.places().collect::<Vec<_>>(),
            self.values.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
        ];
        places.sort_unstable();
        names.sort_unstable();
        places == names
            && self.values.iter().all(|(_, value)| match value {
                Value::Phrases { all, .. } => all.iter().all(Self::is_whole),
                Value::Text(_) | Value::Number(_) => true,
            })
    }
}

impl fmt::Display for Phrase {
    /// In English.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.say(&English))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    mod table {
        templates! {
            LESIONS = "{count} lesions{why}";
            WHY = "({text})";
            PLAIN = "nothing";
        }
    }

    #[test]
    fn a_phrase_says_its_values_and_those_of_the_phrases_in_it() {
        let why = |text: &str| table::WHY.with([("text", text.into())]);
        let lesions = |all| {
            let why = Value::Phrases { before: " ", between: " ", all };
            table::LESIONS.with([("count", Value::number(2)), ("why", why)])
        };
        assert_eq!(lesions(Vec::new()).to_string(), "2 lesions");
        // What a user wrote is no template.
        assert_eq!(lesions(vec![why("{count}"), why("}{")]).to_string(), "2 lesions ({count}) (}{)");
        assert_eq!(Phrase::from(table::PLAIN).to_string(), "nothing");
    }

    #[test]
    fn values_are_those_of_the_template() {
        assert!(Phrase::from(table::PLAIN).is_whole());
        assert!(!Phrase::from(table::WHY).is_whole());
        let inner = Value::after(" ", Some(table::WHY.into()));
        assert!(!table::LESIONS.with([("count", Value::number(1)), ("why", inner)]).is_whole());
    }

    #[test]
    fn templates_have_keys_and_places() {
        assert_eq!(
            table::ALL.iter().map(|template| template.key()).collect::<Vec<_>>(),
            ["lesions", "why", "plain"]
        );
        assert_eq!(table::LESIONS.places().collect::<Vec<_>>(), ["count", "why"]);
    }
}
