//! The contents of `crates/messages/src/layouts.rs`, the files below it and `crates/messages/src/state.rs`, read from
//! their text: layouts, constants, enums, and the doc comments on all of them.

use std::collections::BTreeMap;

use syn::{Attribute, Expr, Fields, GenericArgument, Item, ItemEnum, ItemStruct, Lit, Meta, PathArguments, Type};

/// A number type of a layout, with its name in each language.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Primitive {
    pub rust: &'static str,
    pub ros: &'static str,
    pub ctypes: &'static str,
}

const PRIMITIVES: [Primitive; 7] = [
    Primitive { rust: "f64", ros: "float64", ctypes: "c_double" },
    Primitive { rust: "f32", ros: "float32", ctypes: "c_float" },
    Primitive { rust: "u64", ros: "uint64", ctypes: "c_uint64" },
    Primitive { rust: "u32", ros: "uint32", ctypes: "c_uint32" },
    Primitive { rust: "i64", ros: "int64", ctypes: "c_int64" },
    Primitive { rust: "i32", ros: "int32", ctypes: "c_int32" },
    Primitive { rust: "u8", ros: "uint8", ctypes: "c_uint8" },
];

/// The type of a field.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    Number(Primitive),
    /// UTF-8 in an array of this many bytes, padded with zeros.
    Text(u64),
    /// Another layout.
    Layout(String),
    Array(Box<Kind>, u64),
    /// A list of at most this many.
    List(Box<Kind>, u64),
}

/// The paragraphs of a doc comment, without its examples, which are for Rust alone.
pub type Docs = Vec<String>;

pub struct Field {
    pub name: String,
    pub docs: Docs,
    pub kind: Kind,
}

pub struct Layout {
    pub name: String,
    pub version: u32,
    pub docs: Docs,
    pub fields: Vec<Field>,
}

pub struct Constant {
    pub name: String,
    pub docs: Docs,
    pub value: u64,
    /// True if a field may hold the constant, false for the length of an array.
    pub is_on_the_wire: bool,
}

/// One value of an enum: its name in JSON, its number on the wire.
#[derive(Clone)]
pub struct Variant {
    pub name: String,
    pub number: u64,
    pub docs: Docs,
}

pub struct Enumeration {
    pub name: String,
    pub docs: Docs,
    pub variants: Vec<Variant>,
}

/// All items, in the order of the files.
pub struct Source {
    pub layouts: Vec<Layout>,
    pub constants: Vec<Constant>,
    /// The enums of `show::state`, and `EventKind`, each kind with the number of the state that it leads to.
    pub enums: Vec<Enumeration>,
}

impl Source {
    /// Reads the sources of this checkout.
    pub fn read() -> Self {
        let files = [
            "crates/messages/src/layouts.rs",
            "crates/messages/src/layouts/chase.rs",
            "crates/messages/src/layouts/control.rs",
            "crates/messages/src/layouts/stage.rs",
        ];
        let layouts: Vec<_> = files.into_iter().flat_map(items).collect();
        let states = items("crates/messages/src/state.rs");
        let mut enums: Vec<_> = states.iter().filter_map(enumeration).collect();
        let kinds = enums.iter().position(|item| item.name == "EventKind").unwrap();
        let mut kinds = enums.remove(kinds);
        let states = &enums.iter().find(|item| item.name == "FrameState").unwrap().variants;
        for kind in &mut kinds.variants {
            let state = states.iter().find(|state| state.name == kind.name);
            kind.number = state.unwrap_or_else(|| panic!("no state for the event {}", kind.name)).number;
        }
        enums.push(kinds);
        let constants: Vec<_> = layouts.iter().filter_map(constant).collect();
        let lengths: BTreeMap<_, _> =
            constants.iter().map(|constant| (constant.name.clone(), constant.value)).collect();
        let texts = layouts.iter().filter_map(|item| text_bytes(item, &lengths)).collect();
        let layouts = layouts.iter().filter_map(|item| layout(item, &texts, &lengths)).collect();
        Self { layouts, constants, enums }
    }

    pub fn layout(&self, name: &str) -> Option<&Layout> {
        self.layouts.iter().find(|layout| layout.name == name)
    }

    pub fn enumeration(&self, name: &str) -> Option<&Enumeration> {
        self.enums.iter().find(|item| item.name == name)
    }

    pub fn constant(&self, name: &str) -> Option<&Constant> {
        self.constants.iter().find(|constant| constant.name == name)
    }

    /// Returns the constants that a field may hold and whose names begin with `prefix`.
    pub fn group(&self, prefix: &str) -> Vec<&Constant> {
        let is_in_it = |constant: &&Constant| constant.is_on_the_wire && constant.name.starts_with(prefix);
        let group: Vec<_> = self.constants.iter().filter(is_in_it).collect();
        assert!(!group.is_empty(), "no constant is called {prefix}*");
        group
    }
}

/// Returns the texts of the links in a text, such as `NO_BENCH` or `FrameHeader::state`.
pub fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("[`").skip(1).map(|rest| rest.split_once('`').expect("a link ends").0)
}

/// Returns a text with each link replaced by `words` of the link's text.
pub fn without_links(text: &str, words: impl Fn(&str) -> String) -> String {
    let mut pieces = text.split("[`");
    let mut plain = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let (link, rest) = piece.split_once("`]").expect("a link ends");
        // A link with a separate target: [`link`](target).
        let rest = match rest.strip_prefix('(') {
            Some(target) => target.split_once(')').expect("a target ends").1,
            None => rest,
        };
        plain += &words(link);
        plain += rest;
    }
    plain
}

fn items(path: &str) -> Vec<Item> {
    let text = std::fs::read_to_string(format!("{}/{path}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    syn::parse_file(&text).unwrap_or_else(|error| panic!("{path}: {error}")).items
}

fn docs(attributes: &[Attribute]) -> Docs {
    let lines = attributes.iter().filter_map(|attribute| match &attribute.meta {
        Meta::NameValue(pair) if pair.path.is_ident("doc") => match &pair.value {
            Expr::Lit(literal) => match &literal.lit {
                Lit::Str(line) => Some(line.value().trim().to_owned()),
                _ => None,
            },
            _ => None,
        },
        _ => None,
    });
    let lines: Vec<_> = lines.take_while(|line| line != "# Examples").collect();
    lines.split(String::is_empty).map(|paragraph| paragraph.join(" ")).filter(|text| !text.is_empty()).collect()
}

fn enumeration(item: &Item) -> Option<Enumeration> {
    let Item::Enum(ItemEnum { ident, attrs, variants, .. }) = item else { return None };
    let mut next = 0;
    let variants = variants.iter().map(|variant| {
        // Numbers may be left out, but they grow.
        let given = variant.discriminant.as_ref().map(|(_, given)| number(given));
        let number = given.unwrap_or(next);
        assert!(number >= next, "{ident} is not in the order of its numbers");
        next = number + 1;
        Variant { name: snake_case(&variant.ident.to_string()), number, docs: docs(&variant.attrs) }
    });
    Some(Enumeration { name: ident.to_string(), docs: docs(attrs), variants: variants.collect() })
}

/// Returns the value of a literal integer.
fn number(of: &Expr) -> u64 {
    match of {
        Expr::Lit(literal) => match &literal.lit {
            Lit::Int(number) => number.base10_parse().unwrap(),
            _ => panic!("a discriminant is not an integer"),
        },
        _ => panic!("a discriminant is not a literal"),
    }
}

fn snake_case(name: &str) -> String {
    let words = name.char_indices().map(|(at, letter)| {
        let gap = if at > 0 && letter.is_uppercase() { "_" } else { "" };
        format!("{gap}{}", letter.to_lowercase())
    });
    words.collect()
}

fn constant(item: &Item) -> Option<Constant> {
    let Item::Const(item) = item else { return None };
    let name = item.ident.to_string();
    let value = match &*item.expr {
        Expr::Lit(literal) => match &literal.lit {
            Lit::Int(number) => number.base10_parse().unwrap(),
            _ => return None,
        },
        Expr::Path(path) if path.path.segments.last()?.ident == "MAX" => u32::MAX.into(),
        _ => panic!("{name} is neither a number nor u32::MAX"),
    };
    let is_on_the_wire = type_name(&item.ty) == Some("u32".to_owned());
    Some(Constant { name, docs: docs(&item.attrs), value, is_on_the_wire })
}

/// Returns the name and length of a struct around an array of bytes that holds a text.
fn text_bytes(item: &Item, lengths: &BTreeMap<String, u64>) -> Option<(String, u64)> {
    let Item::Struct(ItemStruct { ident, fields: Fields::Unnamed(fields), .. }) = item else { return None };
    match kind(&fields.unnamed.first()?.ty, &BTreeMap::new(), lengths) {
        Kind::Array(element, length) if *element == Kind::Number(PRIMITIVES[6]) => Some((ident.to_string(), length)),
        other => panic!("{ident} holds {other:?}"),
    }
}

fn layout(item: &Item, texts: &BTreeMap<String, u64>, lengths: &BTreeMap<String, u64>) -> Option<Layout> {
    let Item::Struct(ItemStruct { ident, attrs, fields: Fields::Named(fields), .. }) = item else { return None };
    let name = ident.to_string();
    let type_name = attrs.iter().find(|attribute| attribute.path().is_ident("type_name"));
    let type_name = type_name.unwrap_or_else(|| panic!("{name} has no type_name")).parse_args::<syn::LitStr>();
    let type_name = type_name.unwrap().value();
    let version = type_name.strip_prefix(&format!("bench_dragon/{name}/")).and_then(|version| version.parse().ok());
    let fields = fields.named.iter().map(|field| Field {
        name: field.ident.as_ref().unwrap().to_string(),
        docs: docs(&field.attrs),
        kind: kind(&field.ty, texts, lengths),
    });
    let fields: Vec<_> = fields.collect();
    for Field { name: field, docs, .. } in &fields {
        assert!(!docs.is_empty(), "{name}::{field} has no comment");
    }
    let version = version.unwrap_or_else(|| panic!("{name} is called {type_name}"));
    Some(Layout { name, version, docs: docs(attrs), fields })
}

fn kind(of: &Type, texts: &BTreeMap<String, u64>, lengths: &BTreeMap<String, u64>) -> Kind {
    if let Type::Array(array) = of {
        let length = match &array.len {
            Expr::Lit(literal) => match &literal.lit {
                Lit::Int(number) => number.base10_parse().unwrap(),
                _ => panic!("an array's length is a number"),
            },
            Expr::Path(path) => lengths[&path.path.get_ident().unwrap().to_string()],
            _ => panic!("an array's length is a number or a constant"),
        };
        return Kind::Array(Box::new(kind(&array.elem, texts, lengths)), length);
    }
    if let Some((element, most)) = list(of) {
        return Kind::List(Box::new(kind(element, texts, lengths)), lengths[&most]);
    }
    let name = type_name(of).expect("a type with a name");
    match PRIMITIVES.iter().find(|primitive| primitive.rust == name) {
        Some(primitive) => Kind::Number(*primitive),
        None => texts.get(&name).map_or(Kind::Layout(name), |bytes| Kind::Text(*bytes)),
    }
}

/// Returns the type of the elements of a `List`, and the constant with the most elements.
fn list(of: &Type) -> Option<(&Type, String)> {
    let Type::Path(path) = of else { return None };
    let segment = path.path.segments.last().filter(|segment| segment.ident == "List")?;
    let PathArguments::AngleBracketed(arguments) = &segment.arguments else { return None };
    match (arguments.args.first()?, arguments.args.last()?) {
        (GenericArgument::Type(element), GenericArgument::Type(most)) => Some((element, type_name(most)?)),
        _ => None,
    }
}

fn type_name(of: &Type) -> Option<String> {
    let Type::Path(path) = of else { return None };
    Some(path.path.segments.last()?.ident.to_string())
}
