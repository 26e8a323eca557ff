//! Declares the keys of `items.toml` and `published.toml`.

use damprig::input::key::DefaultValue::{Number, Word};
use damprig::input::key::Need::{Default, IfWord, Optional, Required};
use damprig::input::key::Range::{Any, Whole};
use damprig::input::key::{KeyedQuantity, Table, ValueKind, key, number, tables, word};

/// Methods of their own that compute a part.
pub const METHODS: &[&str] = &["scheme"];

tables! {
    "All tables of `items.toml` and `published.toml`."

    "The top level of `items.toml`."
    items("") {
        ITEM: Required, [key("item", ValueKind::Tables, "the figures and tables, one after the other")];
    }

    "A figure or table."
    item("item") {
        NAME: Required, [key("name", ValueKind::Text, "name in commands and of its folder: fig-3-9, table-3-4, eq-5-18")];
        TITLE: Required, [key("title", ValueKind::Text, "what it shows")];
        KIND: Required, [word("kind", &["computed", "virtual_rig", "measured_only"], "computed from a model, measured on the virtual rig, or known only as a measurement")];
        REASON: IfWord(&KIND, "measured_only", &Required, &Optional), [key("reason", ValueKind::Text, "why it is of this kind")];
        READING: IfWord(&KIND, "measured_only", &Optional, &Required), [key("reading", ValueKind::Text, "how the main parts read the document where it leaves something open")];
        PART: IfWord(&KIND, "measured_only", &Optional, &Required), [key("part", ValueKind::Tables, "what is computed, in this order")];
    }

    "A part of an item."
    part("item.part") {
        NAME: Required, [key("name", ValueKind::Text, "name of its folder")];
        TITLE: Required, [key("title", ValueKind::Text, "what it shows")];
        WHAT: Required, [
            key("study", ValueKind::Text, "a study file"),
            key("cases", ValueKind::Texts, "case files: their time histories over each other"),
            key("bifurcation", ValueKind::Table, "a bifurcation diagram"),
            key("continuation", ValueKind::Text, "a continuation file"),
            key("campaign", ValueKind::Text, "a campaign file for the virtual rig"),
            word("method", METHODS, "code of its own"),
        ];
        READ_AS: Optional, [
            key("read_as", ValueKind::Table, "rows of its table that stand for printed ones: { KEY = { PRINTED = VALUE } }"),
        ];
    }

    "A bifurcation diagram, with the options of `damprig study bifurcation`."
    bifurcation("item.part.bifurcation") {
        CASE: Required, [key("case", ValueKind::Text, "the case file")];
        AXIS: Required, [key("axis", ValueKind::Text, "KEY=FROM:TO:COUNT")];
        DIRECTION: Default(Word("both")), [word("direction", &["both", "up", "down"], "directions of the sweep")];
        SETTLE: Default(Number(200.0)), [number("settle_cycles", Whole(0.0, 1e6), "cycles at each value before sampling")];
        CYCLES: Default(Number(60.0)), [number("cycles", Whole(1.0, 1e6), "sampled cycles at each value")];
        SECTION: Optional, [number("section", Any, "value at which the Poincaré section is drawn too")];
        SET: Optional, [key("set", ValueKind::Texts, "KEY=VALUE, in place of values of the case")];
    }

    "The top level of `published.toml`."
    published("") {
        VALUE: Optional, [key("value", ValueKind::Tables, "the published values")];
        CURVE: Optional, [key("curve", ValueKind::Tables, "the published curves")];
    }

    "A published value."
    value("value") {
        ITEM: Required, [key("item", ValueKind::Text, "the figure or table, by its name in items.toml")];
        LABEL: Required, [key("label", ValueKind::Text, "a short label, unique within the item")];
        ORIGIN: Optional, [word("origin", &["computed", "measured"], "how the document got it")];
        SOURCE: Optional, [key("source", ValueKind::Text, "where it is printed")];
        VALUE: Optional, [number("value", Any, "the value, in the unit of the quantity; left out: a gap")];
        QUANTITY: Optional, [key("quantity", ValueKind::Text, "the column of the part's table that it is compared with")];
        AT: Optional, [key("at", ValueKind::Table, "the row of that table: columns and their values")];
        PART: Optional, [key("part", ValueKind::Text, "the part that it is compared with; default: the first")];
        BELOW: Optional, [key("below", ValueKind::Table, "the row that it is a reduction from, in %: columns and their values")];
        BELOW_PART: Optional, [key("below_part", ValueKind::Text, "the part of that row; default: the same")];
        CLAIM: Optional, [number("claim", Whole(1.0, 14.0), "number of the claim that judges it, if it is not compared by itself")];
        NOTE: Optional, [key("note", ValueKind::Text, "what is to be known about it")];
    }

    "A published curve. The document has it as a picture only, so its points are a gap until someone reads them off."
    curve("curve") {
        ITEM: Required, [key("item", ValueKind::Text, "the figure, by its name in items.toml")];
        LABEL: Required, [key("label", ValueKind::Text, "a short label, unique within the item")];
        ORIGIN: Optional, [word("origin", &["computed", "measured"], "how the document got it")];
        SOURCE: Optional, [key("source", ValueKind::Text, "where it is printed")];
        PART: Optional, [key("part", ValueKind::Text, "the part, a study, that it is compared with")];
        QUANTITY: Optional, [key("quantity", ValueKind::Text, "the metric that it shows")];
        OVER: Optional, [key("over", ValueKind::Text, "the axis of the study that is its abscissa")];
        AT: Optional, [key("at", ValueKind::Table, "the other axes and their values")];
        ABSCISSAE: Optional, [key("abscissae", ValueKind::Numbers(Any), "abscissae of its points; left out: a gap")];
        VALUES: Optional, [key("values", ValueKind::Numbers(Any), "the values there, in the unit of the quantity")];
    }
}
