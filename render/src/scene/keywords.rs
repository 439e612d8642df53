//! How choices are spelled: in sessions in snake case, on the command line in kebab case.

/// Declares an enum of choices without data, whose names sessions, menus and the command line derive from its variants.
macro_rules! keywords {
    ($($choice:item)*) => {$(
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        #[derive(strum::EnumString, strum::IntoStaticStr, strum::VariantArray, strum::VariantNames)]
        #[serde(rename_all = "snake_case")]
        #[strum(serialize_all = "kebab-case")]
        $choice
    )*};
}

pub(crate) use keywords;
