// Inheritance between the types of node tables, and the checks that need every type: fields, aspects, tags.
#include <algorithm>
#include <cctype>
#include <ranges>

#include "spec_model.h"

namespace spec {

void Model::inherit(Type& type, const Type& base) {
    if (base.isAbstract && std::ranges::find(type.implements, base.name) == type.implements.end())
        type.implements.push_back(base.name);
    for (const std::string& name : base.implements)
        if (std::ranges::find(type.implements, name) == type.implements.end()) type.implements.push_back(name);
    for (const Field& field : base.fields) {
        const auto known = std::ranges::find(type.fields, field.name, &Field::name);
        const auto redefined = std::ranges::find(type.own, field.name, &Field::name);
        if (known == type.fields.end()) {
            type.fields.push_back(field);
        } else if (redefined == type.own.end()) {
            const bool same = known->type == field.type && known->custom == field.custom &&
                              known->access == field.access && known->defaultText == field.defaultText &&
                              known->accepts == field.accepts && known->min == field.min && known->max == field.max;
            const bool retagged = std::ranges::any_of(type.retags, [&](const Retag& retag) {
                return std::ranges::find(retag.fields, field.name) != retag.fields.end();
            });
            if (!same || (known->aspect != field.aspect && !retagged))
                error(type.where, "'" + type.name + "' inherits two different fields '" + field.name +
                                      "'; list it, or retag it if only the aspects differ");
        }
    }
}

namespace {

/// The field that an input stands for: set_coordIndex for coordIndex, addChildren and removeChildren for children.
bool standsForAField(const Type& type, std::string_view input) {
    std::string name;
    if (input.starts_with("set_")) {
        name = input.substr(4);
    } else {
        for (const std::string_view verb : {"add", "remove"})
            if (input.starts_with(verb) && input.size() > verb.size()) {
                name = input.substr(verb.size());
                name[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(name[0])));
            }
    }
    return std::ranges::any_of(type.fields,
                               [&](const Field& field) { return field.name == name && field.access != "inputOnly"; });
}

bool isLink(const Field& field) {
    return field.type.ends_with("Node") && field.access != "inputOnly";
}

}  // namespace

/// Its own tags win; two bases that say different things must be settled by one.
void Model::inheritTags(Type& type) {
    Tags& all = type.all;
    all = type.tags;
    for (const std::string& name : type.bases) {
        const Type* base = find(name);
        if (!base) continue;
        all.writesInputs |= base->all.writesInputs;
        if (type.tags.acts.empty() && !base->all.acts.empty()) {
            if (!all.acts.empty() && all.acts != base->all.acts)
                error(type.where, "'" + type.name + "' inherits @acts(" + all.acts + ") and @acts(" + base->all.acts +
                                      "): state which");
            all.acts = base->all.acts;
        }
        if (type.tags.role.empty() && !base->all.role.empty()) {
            if (!all.role.empty() && (all.role != base->all.role || all.below != base->all.below))
                error(type.where, "'" + type.name + "' inherits @role(" + all.role + ") and @role(" + base->all.role +
                                      "): state which");
            all.role = base->all.role;
            all.below = base->all.below;
        }
    }
}

/// A type that can act must say when, and a type that has a place must say which.
void Model::checkTags(const Type& type) {
    if (type.isAbstract) return;
    for (const std::string& name : type.all.below)
        if (std::ranges::none_of(type.fields, [&](const Field& f) { return f.name == name && isLink(f); }))
            error(type.where, "'" + type.name + "' has no field '" + name + "' of nodes");
    const bool canAct = std::ranges::any_of(type.fields, [&](const Field& field) {
        return field.hidden || field.access == "outputOnly" ||
               (field.access == "inputOnly" && !standsForAField(type, field.name));
    });
    if (canAct && type.all.acts.empty())
        error(type.where, "'" + type.name + "' has outputs, state or inputs of its own: it needs @acts(WHEN)");
    if (type.all.role.empty() && std::ranges::find(type.implements, "X3DBoundedObject") != type.implements.end())
        error(type.where, "'" + type.name + "' has bounds: it needs @role(NAME FIELD...)");
}

void Model::resolve(Type& type) {
    if (type.state == 2) return;
    if (type.state == 1) return error(type.where, "'" + type.name + "' inherits from itself");
    type.state = 1;
    for (const std::string& name : type.bases) {
        Type* base = lookup(name);
        if (!base) {
            error(type.where, "'" + type.name + "' inherits from unknown type '" + name + "'");
            continue;
        }
        resolve(*base);
        inherit(type, *base);
    }
    for (const Field& field : type.own) {
        const auto known = std::ranges::find(type.fields, field.name, &Field::name);
        if (known == type.fields.end()) {
            type.fields.push_back(field);
            continue;
        }
        if (known->type != field.type || known->custom != field.custom || known->access != field.access)
            error(field.where, "'" + field.name + "' is inherited with another type or access");
        // A unit that nobody repeats would be gone without a word.
        if (!known->unit.empty() && field.unit.empty())
            error(field.where, "'" + field.name + "' is inherited with @unit(" + known->unit + "): state its unit");
        const int since = field.since ? field.since : known->since;
        *known = field;
        known->since = since;
    }
    for (const Retag& retag : type.retags)
        for (const std::string& name : retag.fields) {
            const auto field = std::ranges::find(type.fields, name, &Field::name);
            if (field == type.fields.end()) {
                error(retag.where, "'" + type.name + "' has no field '" + name + "'");
                continue;
            }
            if (!retag.tags.aspect.empty()) field->aspect = retag.tags.aspect;
            if (!retag.tags.unit.empty()) field->unit = retag.tags.unit;
            if (retag.tags.since) field->since = retag.tags.since;
            checkUnit(retag.where, *field);
        }
    // The order of the standard's tables: by name, whatever the case; then the hidden ones as written.
    std::vector<Field> hidden;
    for (const Field& field : type.fields)
        if (field.hidden) hidden.push_back(field);
    std::erase_if(type.fields, [](const Field& field) { return field.hidden; });
    std::ranges::sort(type.fields, {}, [](const Field& field) {
        std::string key = field.name;
        for (char& c : key)
            if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
        return key + '\0' + field.name;
    });
    type.fields.insert(type.fields.end(), hidden.begin(), hidden.end());
    inheritTags(type);
    type.state = 2;
}

void Model::resolve() {
    for (const Extension& extension : extensions_) {
        Type* type = lookup(extension.name);
        if (!type) {
            error(extension.where, "cannot extend unknown type '" + extension.name + "'");
            continue;
        }
        if (type->imported && !extension.imported) {
            error(extension.where, "'" + extension.name + "' comes from an imported table and cannot be extended");
            continue;
        }
        for (const Field& field : extension.own) {
            if (std::ranges::find(type->own, field.name, &Field::name) != type->own.end())
                error(field.where, "'" + extension.name + "' already has a field '" + field.name + "'");
            type->own.push_back(field);
        }
    }
    for (Type& type : types_) resolve(type);
    for (const Type& type : types_) checkTags(type);
    for (const Type& type : types_)
        for (const Field& field : type.own)
            for (const auto name : std::views::split(field.accepts, '|')) {
                const std::string_view text(name.begin(), name.end());
                if (!text.empty() && !find(text))
                    error(field.where, "'" + field.name + "' accepts unknown type '" + std::string(text) + "'");
            }
}

}  // namespace spec
