// DISEntityManager: an EspduTransform for each entity in PDUs that no node represents (28.3).
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "stations.h"

namespace rtsg {

using namespace dis;

namespace {

using Espdu = x3d::EspduTransform;
using Mapping = x3d::DISEntityTypeMapping;

/// The number of fields in which a mapping equals the entity's type; -1 if one differs. 0 in a mapping matches
/// anything.
int fitOf(const Node& mapping, const EntityType& type) {
    const std::pair<std::int32_t, std::int32_t> numbers[] = {
        {mapping.get(Mapping::kind), type.kind},
        {mapping.get(Mapping::domain), type.domain},
        {mapping.get(Mapping::country), type.country},
        {mapping.get(Mapping::category), type.category},
        {mapping.get(Mapping::subcategory), type.subcategory},
        {mapping.get(Mapping::specific), type.specific},
        {mapping.get(Mapping::extra), type.extra},
    };
    int count = 0;
    for (const auto& [wanted, is] : numbers) {
        if (wanted != 0 && wanted != is) return -1;
        count += wanted != 0 ? 1 : 0;
    }
    return count;
}

/// The best of them; the first of equals. Null if none fits.
const Node* mappingFor(const Scene& scene, const Node& manager, const EntityType& type) {
    const Node* best = nullptr;
    int maximum = -1;
    for (const NodeId id : manager.get(x3d::DISEntityManager::children)) {
        const Node* mapping = scene.effectiveNode(id);
        if (!mapping || !mapping->is(Mapping::type)) continue;
        if (const int fit = fitOf(*mapping, type); fit > maximum) best = mapping, maximum = fit;
    }
    return best;
}

/// Appends a node to a field, which is sent to the manager in its next frame.
void append(Scene& scene, NodeId manager, Field<Array<NodeId>> field, NodeId node) {
    Array<NodeId> list = scene.node(manager).get(field);
    list.push_back(node);
    (void)scene.setField(manager, field.index, Value(list));
}

}  // namespace

void DisNetwork::Stations::manage(Manager& manager, const Pdu& pdu, double t) {
    if (const auto* removal = std::get_if<RemoveEntity>(&pdu.body)) {
        const auto found = manager.entities.find(removal->receiver);
        if (found != manager.entities.end()) remove(manager, found);
        return;
    }
    const auto* state = std::get_if<EntityState>(&pdu.body);
    if (!state) return;
    const auto found = manager.entities.find(state->id);
    const bool isOver = state->appearance & EntityState::kDeactivated;
    if (found != manager.entities.end()) {
        found->second.heard = t;
        if (isOver) remove(manager, found);
    } else if (!isOver && !readers_.contains({manager.address, {state->id, -1}})) {
        if (manager.entities.size() < kMaxEntities)
            add(manager, *state, t);
        else
            report(manager.node, fmt::format("more than {} entities: the rest is left out", kMaxEntities));
    }
}

void DisNetwork::Stations::add(Manager& manager, const EntityState& state, double t) {
    const Node* node = scene_.find(manager.node);
    if (!node) return;
    const NodeId scope = node->scope();
    const NodeId entity = scene_.createNode(Espdu::type, scope);
    (void)scene_.set(entity, Espdu::siteID, std::int32_t{state.id.site});
    (void)scene_.set(entity, Espdu::applicationID, std::int32_t{state.id.application});
    (void)scene_.set(entity, Espdu::entityID, std::int32_t{state.id.entity});
    (void)scene_.set(entity, Espdu::address, String(manager.address.host));
    (void)scene_.set(entity, Espdu::port, std::int32_t{manager.address.port});
    (void)scene_.set(entity, Espdu::networkMode, String("networkReader"));
    if (const Node* mapping = mappingFor(scene_, *node, state.type)) {
        const NodeId model = scene_.createNode(x3d::Inline::type, mapping->scope());
        (void)scene_.set(model, x3d::Inline::url, Array<String>(mapping->get(Mapping::url)));
        (void)scene_.set(model, x3d::Inline::load, bool{mapping->get(Mapping::load)});
        (void)scene_.insertChild(entity, Espdu::children, model);
    }
    append(scene_, manager.node, x3d::DISEntityManager::_added, entity);
    manager.entities.emplace(state.id, Manager::Entity{entity, t});
    // The PDU by which the entity became known is its first.
    note(scene_.node(entity));
    look(scene_.node(entity));
    dirty_.erase(entity.value);
    readers_[{manager.address, {state.id, -1}}].push_back(entity.value);
}

void DisNetwork::Stations::remove(Manager& manager, std::map<EntityId, Manager::Entity>::iterator entity) {
    const NodeId node = entity->second.node;
    const auto readers = readers_.find({manager.address, {entity->first, -1}});
    manager.entities.erase(entity);
    if (!scene_.find(node) || !scene_.find(manager.node)) return;
    append(scene_, manager.node, x3d::DISEntityManager::_removed, node);
    // It hears nothing more; a new entity of this name is a new node.
    forget(node);
    if (readers != readers_.end() && std::erase(readers->second, node.value) > 0 && readers->second.empty())
        readers_.erase(readers);
    removed_.emplace_back(node, 0);
}

void DisNetwork::Stations::loseSilent(Manager& manager, double t) {
    if (t < manager.nextLook) return;
    manager.nextLook = t + 1;
    for (auto at = manager.entities.begin(); at != manager.entities.end();) {
        const auto entity = at++;
        if (t - entity->second.heard > kTimeout || !scene_.find(entity->second.node)) remove(manager, entity);
    }
}

/// Destroys the nodes of entities that are gone, with their models, once that has been reported and if they hang
/// nowhere. A node that hangs somewhere belongs to whoever put it there.
void DisNetwork::Stations::clearRemoved() {
    std::erase_if(removed_, [&](auto& one) {
        const Node* node = scene_.find(one.first);
        if (!node) return true;
        if (++one.second < 2) return false;  // the frame that says so is still to come
        const auto isManagers = [&](const ParentRef& parent) {
            const Node* above = scene_.find(parent.node);
            return above && above->is(x3d::DISEntityManager::type);
        };
        if (!std::ranges::all_of(scene_.parents(one.first), isManagers)) return true;
        const Array<NodeId> models = node->get(Espdu::children);
        if (one.second == 2) {  // whoever loads lets the models' contents go first
            for (const NodeId model : models)
                if (const Node* below = scene_.find(model); below && below->is(x3d::Inline::type))
                    (void)scene_.set(model, x3d::Inline::load, false);
            return false;
        }
        if (one.second < 4) return false;
        for (const NodeId model : models)
            if (const Node* below = scene_.find(model); below && below->is(x3d::Inline::type))
                (void)scene_.destroyNode(model);
        (void)scene_.destroyNode(one.first);
        return true;
    });
}

}  // namespace rtsg
