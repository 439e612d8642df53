//! Finds branches and loops that depend only on uniforms. Mesa's software driver inlines such values into the shader
//! and recompiles it whenever any uniform of its buffer changes: tens to hundreds of milliseconds per pass and
//! frame, hidden while its disk cache holds the same values.

use std::collections::BTreeSet;

use naga::{AddressSpace, Arena, Block, Expression, Function, Handle, LocalVariable, Module, Statement};

/// What a value depends on, in order of increasing variation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Constant,
    Uniform,
    Varying,
}

struct Finder<'a> {
    module: &'a Module,
    /// Kind of the return value of each function so far.
    returned: Vec<Kind>,
    found: BTreeSet<String>,
}

struct Body<'a> {
    expressions: &'a Arena<Expression>,
    locals: Vec<Kind>,
    returned: Kind,
}

/// Branches and loops whose condition depends only on uniforms, as `function: source line`.
pub(crate) fn uniform_branches(module: &Module, source: &str) -> Vec<String> {
    let mut finder = Finder { module, returned: Vec::new(), found: BTreeSet::new() };
    for (_, function) in module.functions.iter() {
        let returned = finder.function(function, source);
        finder.returned.push(returned);
    }
    for entry in &module.entry_points {
        finder.function(&entry.function, source);
    }
    finder.found.into_iter().collect()
}

impl Finder<'_> {
    fn function(&mut self, function: &Function, source: &str) -> Kind {
        let mut body = Body {
            expressions: &function.expressions,
            locals: vec![Kind::Constant; function.local_variables.len()],
            returned: Kind::Constant,
        };
        // Iterated to a fixed point: loops carry values back.
        loop {
            let before = (body.locals.clone(), body.returned);
            self.block(&function.body, &mut body, Kind::Constant, None);
            if before == (body.locals.clone(), body.returned) {
                break;
            }
        }
        self.block(&function.body, &mut body, Kind::Constant, Some((function, source)));
        body.returned
    }

    fn block(
        &mut self,
        block: &Block,
        body: &mut Body<'_>,
        enclosing: Kind,
        report: Option<(&Function, &str)>,
    ) {
        for statement in block {
            match statement {
                Statement::Block(inner) => self.block(inner, body, enclosing, report),
                Statement::If { condition, accept, reject } => {
                    let kind = self.kind(*condition, body);
                    self.branch(kind, *condition, report);
                    self.block(accept, body, enclosing.max(kind), report);
                    self.block(reject, body, enclosing.max(kind), report);
                }
                Statement::Switch { selector, cases } => {
                    let kind = self.kind(*selector, body);
                    self.branch(kind, *selector, report);
                    for case in cases {
                        self.block(&case.body, body, enclosing.max(kind), report);
                    }
                }
                Statement::Loop { body: inner, continuing, break_if } => {
                    self.block(inner, body, enclosing, report);
                    self.block(continuing, body, enclosing, report);
                    if let Some(condition) = break_if {
                        let kind = self.kind(*condition, body);
                        self.branch(kind, *condition, report);
                    }
                }
                Statement::Return { value } => {
                    let kind = value.map_or(Kind::Constant, |v| self.kind(v, body));
                    body.returned = body.returned.max(kind).max(enclosing);
                }
                Statement::Store { pointer, value } => {
                    let kind = self.kind(*value, body).max(enclosing);
                    if let Some(local) = root(*pointer, body.expressions)
                        && let Some(local_kind) = body.locals.get_mut(local.index())
                    {
                        *local_kind = kind.max(*local_kind);
                    }
                }
                Statement::Call { arguments, .. } => {
                    // Values written through a pointer are unknown.
                    for argument in arguments {
                        if let Some(local) = root(*argument, body.expressions)
                            && let Some(local_kind) = body.locals.get_mut(local.index())
                        {
                            *local_kind = Kind::Varying;
                        }
                    }
                }
                _ => {}
            }
        }
    }

    fn branch(&mut self, kind: Kind, condition: Handle<Expression>, report: Option<(&Function, &str)>) {
        let Some((function, source)) = report.filter(|_| kind == Kind::Uniform) else { return };
        let at = function.expressions.get_span(condition).location(source);
        let text = source.lines().nth((at.line_number as usize).saturating_sub(1)).unwrap_or_default();
        let name = function.name.as_deref().unwrap_or("main");
        self.found.insert(format!("{name}: {}", text.trim()));
    }

    fn kind(&self, handle: Handle<Expression>, body: &Body<'_>) -> Kind {
        let all = |handles: &[Handle<Expression>]| {
            handles.iter().map(|h| self.kind(*h, body)).max().unwrap_or(Kind::Constant)
        };
        match &body.expressions[handle] {
            Expression::Literal(_)
            | Expression::Constant(_)
            | Expression::Override(_)
            | Expression::ZeroValue(_)
            | Expression::LocalVariable(_) => Kind::Constant,
            Expression::Compose { components, .. } => all(components),
            Expression::Access { base, index } => all(&[*base, *index]),
            Expression::AccessIndex { base, .. } => self.kind(*base, body),
            Expression::Splat { value, .. } => self.kind(*value, body),
            Expression::Swizzle { vector, .. } => self.kind(*vector, body),
            Expression::Load { pointer } => self.loaded(*pointer, body),
            Expression::Unary { expr, .. } | Expression::As { expr, .. } => self.kind(*expr, body),
            Expression::Binary { left, right, .. } => all(&[*left, *right]),
            Expression::Select { condition, accept, reject } => all(&[*condition, *accept, *reject]),
            Expression::Relational { argument, .. } => self.kind(*argument, body),
            Expression::Math { arg, arg1, arg2, arg3, .. } => {
                let more = [*arg1, *arg2, *arg3];
                more.into_iter()
                    .flatten()
                    .chain([*arg])
                    .map(|h| self.kind(h, body))
                    .max()
                    .unwrap_or(Kind::Constant)
            }
            Expression::CallResult(function) => {
                self.returned.get(function.index()).copied().unwrap_or(Kind::Varying)
            }
            _ => Kind::Varying,
        }
    }

    /// Kind of a loaded local variable, or of a uniform at a constant index.
    fn loaded(&self, pointer: Handle<Expression>, body: &Body<'_>) -> Kind {
        let mut at = pointer;
        loop {
            match &body.expressions[at] {
                Expression::AccessIndex { base, .. } => at = *base,
                Expression::Access { base, index } => {
                    let fixed =
                        matches!(body.expressions[*index], Expression::Literal(_) | Expression::Constant(_));
                    if !fixed {
                        return Kind::Varying;
                    }
                    at = *base;
                }
                Expression::LocalVariable(local) => {
                    return body.locals.get(local.index()).copied().unwrap_or(Kind::Varying);
                }
                Expression::GlobalVariable(global) => {
                    let uniform = self.module.global_variables[*global].space == AddressSpace::Uniform;
                    return if uniform { Kind::Uniform } else { Kind::Varying };
                }
                _ => return Kind::Varying,
            }
        }
    }
}

fn root(pointer: Handle<Expression>, expressions: &Arena<Expression>) -> Option<Handle<LocalVariable>> {
    match &expressions[pointer] {
        Expression::AccessIndex { base, .. } | Expression::Access { base, .. } => root(*base, expressions),
        Expression::LocalVariable(local) => Some(*local),
        _ => None,
    }
}
