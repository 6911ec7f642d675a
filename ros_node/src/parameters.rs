//! The six parameter services of a node.
//!
//! They are answered as they arrive; the inbox yields the parameters that were set.

use std::cell::RefCell;
use std::rc::Rc;

use super::{EndpointFactory, Inbox, Node, RosError};
use msgs::parameters::Parameters;
use msgs::rcl_interfaces::{
    DescribeParameters, DescribeParametersResponse, GetParameterTypes, GetParameterTypesResponse, GetParameters,
    GetParametersResponse, ListParameters, ListParametersResponse, Parameter, SetParameters, SetParametersAtomically,
    SetParametersAtomicallyResponse, SetParametersResponse,
};
use msgs::service::{Ask, Service};

/// Parameters shared by the node and its services.
pub type SharedParameters = Rc<RefCell<Parameters>>;

impl EndpointFactory {
    /// Offers the parameters of a node, whose name begins with a slash. The inbox yields `convert`
    /// of the parameters that were set, or of the reason why bytes are no request. `check` may
    /// refuse values that type and range allow.
    ///
    /// # Errors
    /// If the middleware refuses it.
    pub fn parameters<T: 'static>(
        &mut self,
        node: &mut Node,
        name: &str,
        inbox: &mut Inbox<T>,
        parameters: &SharedParameters,
        check: fn(&Parameter) -> Result<(), String>,
        convert: impl Fn(Result<Vec<Parameter>, String>) -> T + 'static,
    ) -> Result<(), RosError> {
        let convert: Convert<T> = Rc::new(convert);
        let (shared, made) = (Rc::clone(parameters), Rc::clone(&convert));
        self.service(node, &format!("{name}/get_parameters"), inbox, move |asked| {
            read(asked, &made, |ask: Ask<GetParameters>| {
                ask.answer(|request| GetParametersResponse { values: shared.borrow().values(&request.names) });
            })
        })?;
        let (shared, made) = (Rc::clone(parameters), Rc::clone(&convert));
        self.service(node, &format!("{name}/get_parameter_types"), inbox, move |asked| {
            read(asked, &made, |ask: Ask<GetParameterTypes>| {
                ask.answer(|request| {
                    let values = shared.borrow().values(&request.names);
                    GetParameterTypesResponse { types: values.into_iter().map(|value| value.r#type).collect() }
                });
            })
        })?;
        let (shared, made) = (Rc::clone(parameters), Rc::clone(&convert));
        self.service(node, &format!("{name}/describe_parameters"), inbox, move |asked| {
            read(asked, &made, |ask: Ask<DescribeParameters>| {
                ask.answer(|request| DescribeParametersResponse {
                    descriptors: shared.borrow().descriptors(&request.names),
                });
            })
        })?;
        let (shared, made) = (Rc::clone(parameters), Rc::clone(&convert));
        self.service(node, &format!("{name}/list_parameters"), inbox, move |asked| {
            read(asked, &made, |ask: Ask<ListParameters>| {
                ask.answer(|request| ListParametersResponse {
                    result: shared.borrow().list(&request.prefixes, request.depth),
                });
            })
        })?;
        let (shared, made) = (Rc::clone(parameters), Rc::clone(&convert));
        self.service(node, &format!("{name}/set_parameters"), inbox, move |asked| {
            let set = asked.map(|Ask { request, reply }: Ask<SetParameters>| {
                let mut shared = shared.borrow_mut();
                let outcomes: Vec<_> =
                    request.parameters.iter().map(|named| check(named).and_then(|()| shared.set(named))).collect();
                let set = request.parameters.into_iter().zip(&outcomes).filter(|(_, outcome)| outcome.is_ok());
                let set = set.map(|(parameter, _)| parameter).collect();
                reply.send(SetParametersResponse::of(outcomes));
                set
            });
            made(set)
        })?;
        let shared = Rc::clone(parameters);
        self.service(node, &format!("{name}/set_parameters_atomically"), inbox, move |asked| {
            let set = asked.map(|Ask { request, reply }: Ask<SetParametersAtomically>| {
                let checked = request.parameters.iter().try_for_each(check);
                let outcome = checked.and_then(|()| shared.borrow_mut().set_all(&request.parameters));
                let set = if outcome.is_ok() { request.parameters } else { Vec::new() };
                reply.send(SetParametersAtomicallyResponse { result: outcome.into() });
                set
            });
            convert(set)
        })
    }
}

type Convert<T> = Rc<dyn Fn(Result<Vec<Parameter>, String>) -> T>;

/// Answers a request that sets nothing.
fn read<S: Service, T>(asked: Result<Ask<S>, String>, convert: &Convert<T>, answer: impl FnOnce(Ask<S>)) -> T {
    convert(asked.map(|ask| {
        answer(ask);
        Vec::new()
    }))
}
