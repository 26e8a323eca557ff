//! Declares the keys of `items.toml` and `published.toml`.

use damprig::input::key::DefaultValue::{Number, Word};
use damprig::input::key::Need::{Default, IfWord, Optional, Required};
use damprig::input::key::Range::{Any, Whole};
use damprig::input::key::{Kind, Quantity, Table, key, number, tables, word};

/// Methods of their own that compute a part.
pub const METHODS: &[&str] = &["scheme"];

tables! {
    "All tables of `items.toml` and `published.toml`."

    "The top level of `items.toml`."
    items("") {
        ITEM: Required, [key("item", Kind::Tables, "the figures and tables, one after the other")];
    }

    "A figure or table."
    item("item") {
        NAME: Required, [key("name", Kind::Text, "name in commands and of its folder: fig-3-9, table-3-4, eq-5-18")];
        TITLE: Required, [key("title", Kind::Text, "what it shows")];
        KIND: Required, [word("kind", &["computed", "virtual_rig", "measured_only"], "computed from a model, measured on the virtual rig, or known only as a measurement")];
        REASON: IfWord(&KIND, "measured_only", &Required, &Optional), [key("reason", Kind::Text, "why it is of this kind")];
        READING: IfWord(&KIND, "measured_only", &Optional, &Required), [key("reading", Kind::Text, "how the main parts read the document where it leaves something open")];
        PART: IfWord(&KIND, "measured_only", &Optional, &Required), [key("part", Kind::Tables, "what is computed, in this order")];
    }

    "A part of an item."
    part("item.part") {
        NAME: Required, [key("name", Kind::Text, "name of its folder")];
        TITLE: Required, [key("title", Kind::Text, "what it shows")];
        WHAT: Required, [
            key("study", Kind::Text, "a study file"),
            key("cases", Kind::Texts, "case files: their time histories over each other"),
            key("bifurcation", Kind::Table, "a bifurcation diagram"),
            key("continuation", Kind::Text, "a continuation file"),
            key("campaign", Kind::Text, "a campaign file for the virtual rig"),
            word("method", METHODS, "code of its own"),
        ];
        READ_AS: Optional, [
            key("read_as", Kind::Table, "rows of its table that stand for printed ones: { KEY = { PRINTED = VALUE } }"),
        ];
    }

    "A bifurcation diagram, with the options of `damprig study bifurcation`."
    bifurcation("item.part.bifurcation") {
        CASE: Required, [key("case", Kind::Text, "the case file")];
        AXIS: Required, [key("axis", Kind::Text, "KEY=FROM:TO:COUNT")];
        DIRECTION: Default(Word("both")), [word("direction", &["both", "up", "down"], "directions of the sweep")];
        SETTLE: Default(Number(200.0)), [number("settle_cycles", Whole(0.0, 1e6), "cycles at each value before sampling")];
        CYCLES: Default(Number(60.0)), [number("cycles", Whole(1.0, 1e6), "sampled cycles at each value")];
        SECTION: Optional, [number("section", Any, "value at which the Poincaré section is drawn too")];
        SET: Optional, [key("set", Kind::Texts, "KEY=VALUE, in place of values of the case")];
    }

    "The top level of `published.toml`."
    published("") {
        VALUE: Optional, [key("value", Kind::Tables, "the published values")];
        CURVE: Optional, [key("curve", Kind::Tables, "the published curves")];
    }

    "A published value."
    value("value") {
        ITEM: Required, [key("item", Kind::Text, "the figure or table, by its name in items.toml")];
        LABEL: Required, [key("label", Kind::Text, "a short label, unique within the item")];
        ORIGIN: Optional, [word("origin", &["computed", "measured"], "how the document got it")];
        SOURCE: Optional, [key("source", Kind::Text, "where it is printed")];
        VALUE: Optional, [number("value", Any, "the value, in the unit of the quantity; left out: a gap")];
        QUANTITY: Optional, [key("quantity", Kind::Text, "the column of the part's table that it is compared with")];
        AT: Optional, [key("at", Kind::Table, "the row of that table: columns and their values")];
        PART: Optional, [key("part", Kind::Text, "the part that it is compared with; default: the first")];
        BELOW: Optional, [key("below", Kind::Table, "the row that it is a reduction from, in %: columns and their values")];
        BELOW_PART: Optional, [key("below_part", Kind::Text, "the part of that row; default: the same")];
        CLAIM: Optional, [number("claim", Whole(1.0, 14.0), "number of the claim that judges it, if it is not compared by itself")];
        NOTE: Optional, [key("note", Kind::Text, "what is to be known about it")];
    }

    "A published curve. The document has it as a picture only, so its points are a gap until someone reads them off."
    curve("curve") {
        ITEM: Required, [key("item", Kind::Text, "the figure, by its name in items.toml")];
        LABEL: Required, [key("label", Kind::Text, "a short label, unique within the item")];
        ORIGIN: Optional, [word("origin", &["computed", "measured"], "how the document got it")];
        SOURCE: Optional, [key("source", Kind::Text, "where it is printed")];
        PART: Optional, [key("part", Kind::Text, "the part, a study, that it is compared with")];
        QUANTITY: Optional, [key("quantity", Kind::Text, "the metric that it shows")];
        OVER: Optional, [key("over", Kind::Text, "the axis of the study that is its abscissa")];
        AT: Optional, [key("at", Kind::Table, "the other axes and their values")];
        ABSCISSAE: Optional, [key("abscissae", Kind::Numbers(Any), "abscissae of its points; left out: a gap")];
        VALUES: Optional, [key("values", Kind::Numbers(Any), "the values there, in the unit of the quantity")];
    }
}
