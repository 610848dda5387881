//! The nodes of the server: reads and methods. Every write is refused, and no method changes anything.

use std::cmp::Ordering;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use opcua::server::address_space::AddressSpace;
use opcua::server::diagnostics::NamespaceMetadata;
use opcua::server::node_manager::memory::{
    InMemoryNodeManager, InMemoryNodeManagerBuilder, InMemoryNodeManagerImpl,
};
use opcua::server::node_manager::{
    MethodCall, NodeManagerBuilder, RequestContext, ServerContext, WriteNode,
};
use opcua::sync::RwLock;
use opcua::types::{
    ContentFilter, ExtensionObject, NodeId, StatusCode, UAString, Variant, VariantScalarTypeId,
};
use terminal::cell_stream::Cell;

use crate::model::{self, Builder, DI, MACHINERY, Namespaces, OWN, RESULT};
use crate::objects;
use crate::structures::{ResultData, object};

/// The server's nodes.
pub(crate) type CellManager = InMemoryNodeManager<Nodes>;

/// `Error` of a method: there is no such result.
const NO_RESULT: i32 = -1;

/// Results that clients may ask for, the oldest first.
#[derive(Debug, Default)]
pub(crate) struct Results(Mutex<VecDeque<Kept>>);

/// A result by its identifier.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub(crate) id: String,
    /// It is whole, or will not become so.
    pub(crate) is_ready: bool,
    pub(crate) data: ResultData,
}

impl Results {
    /// Adds a result or replaces it.
    pub(crate) fn keep(&self, kept: Kept) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match all.iter_mut().find(|one| one.id == kept.id) {
            Some(one) => *one = kept,
            None => all.push_back(kept),
        }
    }

    /// Forgets a result.
    pub(crate) fn forget(&self, id: &str) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|one| one.id != id);
    }

    fn find(&self, is_wanted: impl Fn(&Kept) -> bool) -> Option<Kept> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.iter().rev().find(|one| is_wanted(one)).cloned()
    }

    /// The newest first.
    fn ids(&self, most: usize) -> Vec<UAString> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let ids = all.iter().rev().map(|one| one.id.as_str().into());
        ids.take(most).collect()
    }
}

/// A method of the cell.
#[derive(Clone, Debug)]
pub(crate) struct Method {
    pub(crate) id: NodeId,
    pub(crate) name: &'static str,
    /// Number of its arguments.
    pub(crate) arguments: usize,
}

/// What the nodes are, and what methods read.
pub(crate) struct Nodes {
    pub(crate) of: Namespaces,
    pub(crate) results: Arc<Results>,
    namespaces: Vec<NamespaceMetadata>,
    methods: Vec<Method>,
}

/// Builds the types and the objects of the cell.
pub(crate) fn builder(cell: Cell) -> impl NodeManagerBuilder {
    InMemoryNodeManagerBuilder::new(move |context: ServerContext, space: &mut AddressSpace| {
        let mut add = |uri: &str| {
            let mut types = context.type_tree.write();
            let index = types.namespaces_mut().add_namespace(uri);
            space.add_namespace(uri, index);
            index
        };
        let instances = format!("urn:probecell:cell:{}", cell.name);
        let of = Namespaces {
            di: add(DI),
            machinery: add(MACHINERY),
            result: add(RESULT),
            own: add(OWN),
            cell: add(&instances),
        };
        let mut builder = Builder { space, of };
        model::build(&mut builder);
        let methods = objects::build(&mut builder, &cell);
        let published = [(of.di, DI), (of.machinery, MACHINERY), (of.result, RESULT)];
        let metadata = |index: u16, uri: &str, is_subset: bool| NamespaceMetadata {
            namespace_uri: uri.to_owned(),
            namespace_index: index,
            is_namespace_subset: Some(is_subset),
            ..NamespaceMetadata::default()
        };
        let subsets = published.map(|(index, uri)| metadata(index, uri, true));
        let ours = [
            metadata(of.own, OWN, false),
            metadata(of.cell, &instances, false),
        ];
        Nodes {
            of,

            results: Arc::default(),
            namespaces: subsets.into_iter().chain(ours).collect(),
            methods,
        }
    })
}

#[async_trait::async_trait]
impl InMemoryNodeManagerImpl for Nodes {
    async fn init(&self, _space: &mut AddressSpace, _context: ServerContext) {}

    fn name(&self) -> &'static str {
        "cell"
    }

    fn namespaces(&self) -> Vec<NamespaceMetadata> {
        self.namespaces.clone()
    }

    async fn write(
        &self,
        context: &RequestContext,
        space: &RwLock<AddressSpace>,
        nodes: &mut [&mut WriteNode],
    ) -> Result<(), StatusCode> {
        let mut space = space.write();
        let types = context.type_tree.read();
        for node in nodes {
            let refused = space.validate_node_write(context, node.value(), &*types);
            node.set_status(refused.err().unwrap_or(StatusCode::BadNotWritable));
        }
        Ok(())
    }

    #[expect(clippy::mut_mut, reason = "the signature of the trait")]
    async fn call(
        &self,
        _context: &RequestContext,
        _space: &RwLock<AddressSpace>,
        calls: &mut [&mut &mut MethodCall],
    ) -> Result<(), StatusCode> {
        for call in calls {
            let method = self.methods.iter().find(|one| &one.id == call.method_id());
            let answer = match method {
                None => Err(StatusCode::BadMethodInvalid),
                Some(method) => match call.arguments().len().cmp(&method.arguments) {
                    Ordering::Less => Err(StatusCode::BadArgumentsMissing),
                    Ordering::Greater => Err(StatusCode::BadTooManyArguments),
                    Ordering::Equal => self.answer(method.name, call.arguments()),
                },
            };
            match answer {
                Ok(outputs) => {
                    call.set_outputs(outputs);
                    call.set_status(StatusCode::Good);
                }
                Err(status) => call.set_status(status),
            }
        }
        Ok(())
    }
}

impl Nodes {
    /// Handle, answer and error.
    fn answer(&self, name: &str, arguments: &[Variant]) -> Result<Vec<Variant>, StatusCode> {
        let found = match (name, arguments) {
            ("GetLatestResult", [Variant::Int32(_)]) => self.results.find(|one| one.is_ready),
            ("GetResultById", [Variant::String(id), Variant::Int32(_)]) => {
                self.results.find(|one| one.id == id.as_ref())
            }
            (
                "GetResultIdListFiltered",
                [filter, order, Variant::UInt32(most), Variant::Int32(_)],
            ) => {
                if !is_empty_filter(filter) || !is_empty_list(order) {
                    return Err(StatusCode::BadNotSupported);
                }
                let most = if *most == 0 {
                    usize::MAX
                } else {
                    *most as usize
                };
                let ids = self.results.ids(most).into_iter().map(Variant::from);
                let ids: Vec<Variant> = ids.collect();
                let ids = Variant::from((VariantScalarTypeId::String, ids));
                return Ok(vec![0u32.into(), ids, 0i32.into()]);
            }
            _ => return Err(StatusCode::BadInvalidArgument),
        };
        let (result, error) = match found {
            Some(kept) => (object(kept.data), 0),
            None => (ExtensionObject::null(), NO_RESULT),
        };
        Ok(vec![0u32.into(), result.into(), error.into()])
    }
}

fn is_empty_filter(filter: &Variant) -> bool {
    match filter {
        Variant::Empty => true,
        Variant::ExtensionObject(filter) => match filter.inner_as::<ContentFilter>() {
            Some(filter) => filter.elements.as_ref().is_none_or(Vec::is_empty),
            None => filter.is_null(),
        },
        _ => false,
    }
}

fn is_empty_list(list: &Variant) -> bool {
    match list {
        Variant::Empty => true,
        Variant::Array(list) => list.values.is_empty(),
        _ => false,
    }
}
