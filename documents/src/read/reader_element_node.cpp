// Elements that are nodes, for XML and JSON: the field that a node goes into, and its attributes.
#include "reader_element.h"

#include <algorithm>
#include <iterator>

#include <rtsg/core/web_address.h>

#include "commands/spelled_name.h"
#include "commands/suggestion.h"
#include "reader_classic.h"

namespace rtsg::detail {

namespace {

/// Attributes of any element that are no fields.
bool isOrganisational(std::string_view name) {
    return name == "DEF" || name == "USE" || name == "containerField" || name.starts_with("xmlns") ||
           name.find(':') != name.npos;
}
/// Attributes that HTML gives to any element. They are fields of a node that has a field of that name.
bool isOfHtml(std::string_view name) {
    return name == "class" || name == "id" || name == "style";
}

bool hasSourceText(const NodeType& type) {
    return declaresFields(type) || type.name == "ShaderPart";
}

}  // namespace

void ElementReader::startNode(const char* name, Attributes attributes) {
    NodeShape shape = types_.find(name);
    if (!shape.known() && mayBeSpelled(name)) shape = types_.find(readName(name, Spelling::element));
    if (!shape.known()) {
        if (frames_.empty()) return skip({});  // some other kind of XML: its root has been named
        diagnostics_.warning(where(), unknownType(shape.name(), diagnostics_));
    }
    if (shape.proto)
        diagnostics_.warning(where(), std::string("prototypes are used as <ProtoInstance name='") + name + "'>");
    openNode(std::move(shape), attributes);
}

void ElementReader::startInstance(Attributes attributes) {
    const char* name = attribute(attributes, "name");
    const char* use = attribute(attributes, "USE");
    NodeShape shape;
    if (name) shape = types_.findInstance(name);
    if (!shape.proto && use)
        if (const NodeShape* defined = types_.defined(use)) shape = *defined;
    if (!shape.known())
        return skip(name ? "there is no PROTO " + std::string(name) + " here; its instance is left out"
                         : std::string("ProtoInstance needs a name"));
    openNode(std::move(shape), attributes);
}

/// The field of the innermost open element that `child` goes into; none, with `fits`, where nodes are statements.
FieldRef ElementReader::fieldFor(const NodeShape& child, const char* containerField, bool& fits) {
    fits = true;
    if (frames_.empty()) return {};
    const Frame& parent = frames_.back();
    const std::string childName(child.name());
    switch (parent.inside) {
        case Inside::scene:
        case Inside::body:
            return {};
        case Inside::root:
            diagnostics_.warning(where(), childName + " belongs in Scene");
            return {};
        case Inside::declaration:
        case Inside::value:
            fits = parent.into && sf(parent.into.type) == FieldType::SFNode;
            if (!fits && parent.into) error(std::string(parent.into.name) + " takes no nodes");
            return fits ? parent.into : FieldRef{};
        case Inside::node:
            break;
        default:
            fits = false;
            error(childName + " has no place in " + parent.element);
            return {};
    }
    return fieldIn(parent.shape, child, containerField);
}

/// The field of a node of shape `parent` into which `child` goes. If no field takes it, this is the field that the file
/// names, or the default one: the node is kept, though no field of its parent is set.
FieldRef ElementReader::fieldIn(const NodeShape& parent, const NodeShape& child, const char* containerField) {
    const NodeType* type = child.standsFor();
    const std::string_view usual = type ? std::string_view(type->containerField) : "children";
    const std::string_view asked = containerField ? std::string_view(containerField) : usual;
    const auto usable = [&](const FieldRef& field) { return field && field.takesValue() && accepts(field, type); };
    const FieldRef named = findField(parent, asked);
    if (named && named.name != asked)
        if (const std::string outdated = types_.outdatedName(parent, asked); !outdated.empty())
            diagnostics_.warning(where(), "containerField: " + outdated);
    if (usable(named) || !parent.known()) return named ? named : FieldRef{asked, FieldType::MFNode};
    const bool namesNodes = named && named.takesValue() && sf(named.type) == FieldType::SFNode;
    // `children` is written by many programs where nothing is meant by it; any other name that the parent does not have
    // may mean a field of some extension: then the node goes where it goes by default, or nowhere.
    const bool guess = !containerField || asked == "children";
    FieldRef target;
    if (!(containerField && namesNodes)) {
        if (const FieldRef field = findField(parent, usual); usable(field)) target = field;
        for (std::size_t i = 0; guess && !target && type && parent.type && i < parent.type->fields.size(); ++i) {
            const FieldDef& definition = parent.type->fields[i];
            if (definition.hidden || definition.accepts.empty()) continue;
            const FieldRef field{definition.name, definition.type, definition.access, &definition,
                                 definition.custom.get()};
            if (usable(field)) target = field;
        }
    }
    if (!target) {
        const bool isMisspelt = containerField && !named && isMisspelled(asked, child.known());
        diagnostics_.add(isMisspelt ? Severity::error : Severity::warning, where(),
                         containerField && !named ? noFieldForNodes(parent, asked, diagnostics_)
                                                  : misplaced(child.name(), asked, parent.name()));
        return {asked, FieldType::MFNode};
    }
    if (containerField)
        diagnostics_.warning(where(),
                             (named ? "containerField '" + std::string(asked) + "' of " + std::string(parent.name()) +
                                          " does not take " + std::string(child.name())
                                    : "containerField: " + noField(parent, asked, diagnostics_)) +
                                 "; '" + std::string(target.name) + "' is taken instead");
    return target;
}

void ElementReader::openNode(NodeShape shape, Attributes attributes) {
    bool fits = false;
    const FieldRef into = fieldFor(shape, attribute(attributes, "containerField"), fits);
    if (!fits) return skip({});
    if (!frames_.empty()) {
        Frame& parent = frames_.back();
        if (parent.declared) reportDeclaration(parent);
        const bool value = parent.inside == Inside::value || parent.inside == Inside::declaration;
        if (into && parent.inside == Inside::declaration && parent.hasChildren && !isMF(into.type)) {
            diagnostics_.error(where(), "field '" + std::string(into.name) +
                                            "' takes one node, and is given one already; this one is left out");
            return skip({});
        }
        if (into && ((value && parent.hasChildren && !isMF(into.type)) ||
                     (parent.inside == Inside::node && !parent.given.add(into))))
            diagnostics_.warning(where(), surplus(into.name, parent.shape.name()));
        if (parent.inside == Inside::body && !frames_[frames_.size() - 2].prototype->type->hasBody) {
            ProtoType& proto = *frames_[frames_.size() - 2].prototype->type;
            proto.hasBody = true;
            proto.primary = shape.standsFor();
        }
    }
    if (const char* use = attribute(attributes, "USE")) return useNode(use, shape, into.name, into);
    const char* def = attribute(attributes, "DEF");
    if (shape.type && declaresFields(*shape.type)) shape.own = std::make_shared<DeclaredFields>();
    if (def && *def) {
        types_.define(def, shape);
        if (const std::string fault = faultOfDef(def, Spelling::element); !fault.empty())
            diagnostics_.warning(where(), badDef(def, fault));
    }
    if (shape.own && bodies_ > 0 && !held_ && mutedAt_ == kNotMuted) {
        held_ = std::make_unique<HeldScript>(*handler_);
        handler_ = loud_ = &held_->commands();
    }
    handler_->beginNode(shape.name(), def ? def : "", into.name, where());
    const std::size_t number = held_ && mutedAt_ == kNotMuted ? held_->count() : Source::kNotHeld;
    push(Inside::node);
    if (shape.type && hasSourceText(*shape.type)) {
        frames_.back().source = std::make_unique<Source>();
        frames_.back().source->number = number;
    }
    frames_.back().shape = std::move(shape);
    nodeAttributes(attributes);
}

void ElementReader::useNode(std::string_view use, const NodeShape& shape, std::string_view field,
                            const FieldRef& into) {
    const NodeShape* defined = types_.defined(use);
    if (defined && defined->name() != shape.name())
        diagnostics_.warning(where(), std::string(use) + " is a " + std::string(defined->name()) + ", not a " +
                                          std::string(shape.name()));
    if (defined && into && !isTop(Inside::declaration) && !isTop(Inside::value) && accepts(into, shape.standsFor()) &&
        !accepts(into, defined->standsFor()))
        diagnostics_.warning(where(), misplaced(defined->name(), field, frames_.back().shape.name()));
    handler_->useNode(use, field, where());
    push(Inside::leaf);
}

void ElementReader::nodeAttributes(Attributes attributes) {
    const bool instance = std::string_view(element_) == "ProtoInstance";
    for (int i = 0; i < specified_; i += 2) {
        const std::string_view name(attributes[i]);
        if (isOrganisational(name) || (instance && name == "name")) continue;
        if (isOfHtml(name) && !findField(frames_.back().shape, name)) continue;
        setAttribute(attributes[i], attributes[i + 1]);
    }
}

void ElementReader::setAttribute(const char* name, const char* text) {
    Frame& frame = frames_.back();
    const std::string node(frame.shape.name());
    const FieldRef field = types_.findField(frame.shape, name);
    if (!frame.shape.known()) {
        const std::string spelled = mayBeSpelled(name) ? readName(name, Spelling::attribute) : std::string(name);
        handler_->setField(spelled, Value(String(text)), where());  // its type is not known, so it is kept as text
        return;
    }
    attributeName_ = name;
    attributeValue_ = text;
    if (field && field.name != name)
        if (const std::string outdated = types_.outdatedName(frame.shape, name); !outdated.empty())
            diagnostics_.warning(locate(text), outdated);
    if (!field) {
        if (const std::string dropped = droppedField(frame.shape, name); !dropped.empty())
            diagnostics_.warning(locate(text), dropped);
        else
            diagnostics_.error(locate(text), noField(frame.shape, name, diagnostics_));
    } else if (!field.takesValue()) {
        diagnostics_.error(locate(text), std::string(name) + " of " + node + " is an event, it takes no value");
    } else if (sf(field.type) == FieldType::SFNode) {
        diagnostics_.error(locate(text), std::string(name) + " of " + node + " takes nodes, not text");
    } else if (!frame.given.add(field)) {
        diagnostics_.error(locate(text), std::string(name) + " of " + node + " is given already");
    } else {
        Value value;
        if (parseAttribute(name, text, field.type, value, field.custom)) {
            attributeName_ = name;
            units_.toStandard(field.definition, value);
            if (field.definition)
                if (std::string complaint = valueComplaint(*field.definition, value); !complaint.empty())
                    diagnostics_.warning(locate(text), std::move(complaint));
            if (frame.source && field.name == "url" && field.definition) {
                frame.source->url = value.as<Array<String>>();
                frame.source->where = where();
            } else {
                handler_->setField(field.name, std::move(value), where());
            }
        }
    }
    attributeName_ = nullptr;
}

/// `field` in a Script, shader or interface.
void ElementReader::startField(Attributes attributes) {
    const bool script = isTop(Inside::node) && frames_.back().shape.own;
    const bool interface = isTop(Inside::interface), external = isTop(Inside::externProto);
    if (!script && !interface && !external) return skip("field has no place here");
    Frame& parent = frames_.back();
    DeclaredFields& fields = script     ? *parent.shape.own
                             : external ? parent.prototype->type->fields
                                        : frames_[frames_.size() - 2].prototype->type->fields;
    FieldDeclaration field;
    const char* name = attribute(attributes, "name");
    const char* type = attribute(attributes, "type");
    const char* access = attribute(attributes, "accessType");
    const char* value = attribute(attributes, "value");
    if (!name || !*name || !type || !access) return skip("field needs name, type and accessType");
    if (!accessFromKeyword(access, field.access)) return skip("'" + std::string(access) + "' is no accessType");
    if (!fieldTypeFromName(type, field.type, field.custom)) return skip("'" + std::string(type) + "' is no field type");
    field.name = name;
    field.about = documentation(attributes);
    if (script && parent.shape.type->findExact(name) != kNoField) {
        // X3D 4.0 gave Script a description; scripts of before may declare one, meaning the same.
        diagnostics_.warning(where(), "Script has a field '" + field.name + "' of its own");
        if (value && haveOneType(findField(parent.shape, name), field)) setAttribute(name, value);
        return skip({});
    }
    if (!fields.add(field)) return skip("there is a field '" + field.name + "' already");
    const FieldRef ref = findField(fields, name);
    if (external) return push(Inside::leaf);
    if (!ref.takesValue()) {
        if (value && *value) error("the event " + field.name + " takes no value");
        handler_->declareField(field, std::nullopt, where());
        return push(Inside::leaf);
    }
    if (sf(field.type) == FieldType::SFNode) {
        push(Inside::declaration);
        frames_.back().into = ref;
        frames_.back().declared = std::make_unique<FieldDeclaration>(std::move(field));
        return;
    }
    Value parsed = zeroOf(field.type, field.custom.get());
    if (value && !parseAttribute("value", value, field.type, parsed, field.custom.get()))
        parsed = zeroOf(field.type, field.custom.get());
    units_.toStandard(nullptr, parsed);
    handler_->declareField(field, std::move(parsed), where());
    push(Inside::leaf);
}

/// Tells of a node-valued field: its first node is about to come, or there is none (then `frame` has been popped).
void ElementReader::reportDeclaration(Frame& frame) {
    const std::unique_ptr<FieldDeclaration> field = std::move(frame.declared);
    const bool nodesFollow = !frames_.empty() && &frame == &frames_.back();
    handler_->declareField(*field, nodesFollow ? std::nullopt : std::optional(Value::zero(field->type)), frame.open);
}

/// Reports the connections of the fields that a Script declares, all of which are known by now.
void ElementReader::reportConnections(Frame& frame) {
    HeldScript::Connections connections;
    for (auto& [name, protos] : frame.source->connections) {
        if (const FieldRef field = findField(frame.shape, name))
            std::ranges::move(protos, std::back_inserter(connections[std::string(field.name)]));
        else
            diagnostics_.error(frame.open, std::string(frame.shape.name()) + " has no field '" + name + "' to connect");
    }
    if (frame.source->number != Source::kNotHeld) held_->connect(frame.source->number, std::move(connections));
}

void ElementReader::endNode(Frame& frame) {
    if (frame.source) {
        Source& source = *frame.source;
        reportConnections(frame);
        Array<String> url = source.url ? *source.url : Array<String>();
        const std::size_t start = source.text.find_first_not_of(" \t\r\n");
        const bool hasText = start != source.text.npos;
        if (hasText && frame.shape.type->name == "Script") {
            const std::string_view text = std::string_view(source.text).substr(start);
            url.push_back(programInUrl(text) ? String(text) : String("ecmascript:" + source.text));
        } else if (hasText) {
            url.push_back(String(source.text));
        }
        if (source.url || hasText) {
            if (const FieldRef field = findField(frame.shape, "url"))
                handler_->setField(field.name, Value(std::move(url)), source.url ? source.where : frame.open);
            else
                diagnostics_.error(frame.open, std::string(frame.shape.name()) + " takes no source text");
        }
    }
    handler_->endNode(where());
    if (!frame.source || frame.source->number != 0) return;
    const std::unique_ptr<HeldScript> held = std::move(held_);
    handler_ = loud_ = &held->next();
    held->report();
}

void ElementReader::startFieldValue(Attributes attributes) {
    if (!isTop(Inside::node) || !frames_.back().shape.proto) return skip("fieldValue belongs in ProtoInstance");
    const char* name = attribute(attributes, "name");
    const char* value = attribute(attributes, "value");
    const NodeShape& shape = frames_.back().shape;
    if (!name) return skip("fieldValue needs a name");
    const FieldRef field = findField(shape, name);
    if (!field && !value) {
        // The nodes in it keep their names.
        error(noFieldForNodes(shape, name, diagnostics_));
        push(Inside::value);
        frames_.back().shape.unknown = std::make_shared<const std::string>(name);
        frames_.back().into = {*frames_.back().shape.unknown, FieldType::MFNode};
        frames_.back().hasChildren = true;  // no empty list is meant
        return;
    }
    if (!field) return skip(noField(shape, name, diagnostics_));
    if (!frames_.back().given.add(field)) return skip(std::string(name) + " is given already");
    if (!field.takesValue()) return skip(std::string(name) + " is an event, it takes no value");
    if (sf(field.type) != FieldType::SFNode) {
        Value parsed;
        if (!value) {
            error("fieldValue of " + std::string(name) + " has no value");
        } else if (parseAttribute("value", value, field.type, parsed, field.custom)) {
            units_.toStandard(nullptr, parsed);
            handler_->setField(field.name, std::move(parsed), where());
        }
        return push(Inside::leaf);
    }
    push(Inside::value);
    frames_.back().into = field;
}

void ElementReader::startIs(Attributes) {
    if (!isTop(Inside::node)) return skip("IS belongs in a node");
    if (bodies_ == 0) return skip("IS has a meaning in the body of a PROTO only");
    push(Inside::is);
}

void ElementReader::startConnect(Attributes attributes) {
    if (!isTop(Inside::is)) return skip("connect belongs in IS");
    const char* nodeField = attribute(attributes, "nodeField");
    const char* protoField = attribute(attributes, "protoField");
    Frame& node = frames_[frames_.size() - 2];
    if (!nodeField || !protoField) {
        error("connect needs nodeField and protoField");
    } else {
        const FieldRef field = findField(node.shape, nodeField);
        // Fields of its own may be declared behind it.
        const bool declared = node.source && (!field || (node.shape.own && !field.definition));
        if (declared)
            node.source->connections[field ? std::string(field.name) : std::string(nodeField)].emplace_back(protoField);
        else if (field || !node.shape.known())
            handler_->isConnection(field ? field.name : std::string_view(nodeField), protoField, where());
        else
            error(noField(node.shape, nodeField, diagnostics_) + " to connect");
    }
    push(Inside::leaf);
}

}  // namespace rtsg::detail
