// Keeps what plug-ins and programs add, and hands it to scenes, worlds and renderers.
#include <rtsg/plugins/extensions.h>

#include <exception>
#include <string_view>

#include <fmt/format.h>

namespace rtsg {

namespace {

/// The dialect that is there, as a new one that more can be added to: whoever has taken the old one keeps that.
template <class Added>
auto withMore(std::shared_ptr<const Dialect>& dialect, Added added) {
    auto more = dialect ? std::make_shared<Dialect>(*dialect) : std::make_shared<Dialect>();
    if constexpr (std::is_void_v<decltype(more->add(std::move(added)))>) {
        more->add(std::move(added));
        dialect = std::move(more);
    } else {
        auto ok = more->add(std::move(added));
        if (ok) dialect = std::move(more);
        return ok;
    }
}

}  // namespace

Result<> Extensions::note(Result<> added) {
    if (added_ && !added) added_ = added;
    return added;
}

void Extensions::add(FormatReader reader) {
    if (reader.recognises && reader.read)
        withMore(dialect_, std::move(reader));
    else
        (void)note(fail(fmt::format("the reader of '{}' files lacks a function", reader.name)));
}

void Extensions::add(FormatWriter writer) {
    if (writer.make)
        withMore(dialect_, std::move(writer));
    else
        (void)note(fail(fmt::format("the writer of '{}' files lacks its function", writer.name)));
}

Result<> Extensions::add(std::shared_ptr<const NodeType> type) {
    if (!type) return note(fail("a node type is null"));
    if (type->fieldCount() != type->fields.size())
        return note(fail(fmt::format("the node type {} is not finished", type->name)));
    return note(withMore(dialect_, std::move(type)));
}

Result<> Extensions::add(std::vector<std::unique_ptr<NodeType>> types) {
    for (auto& type : types)
        if (auto ok = add(std::shared_ptr<const NodeType>(std::move(type))); !ok) return ok;
    return {};
}

Result<std::shared_ptr<const CustomType>> Extensions::addFieldType(std::string_view name, CustomLayout layout,
                                                                   CustomFunctions functions) {
    return registerFieldType(name, layout, std::move(functions));
}

void Extensions::addBehaviour(std::string type, const Behaviour& behaviour) {
    behaviours_.emplace_back(std::move(type), behaviour);
}

void Extensions::addMeshSource(std::string type, MeshSource source) {
    meshSources_.emplace_back(std::move(type), std::move(source));
}

void Extensions::registerWith(Scene& scene) const {
    if (dialect_) registerDocuments(scene, dialect_);
    for (const auto& [type, behaviour] : behaviours_) scene.registerBehaviour(type, behaviour);
}

void Extensions::registerWith(SharedWorld& world) const {
    for (const auto& [type, source] : meshSources_) world.setMeshSource(type, source);
}

void Extensions::registerWith(Flattener& flattener, const Scene& scene) const {
    for (const auto& [type, source] : meshSources_) flattener.setMeshSource(scene, type, source);
}

bool Extensions::registerWith(Renderer& renderer) const {
    bool any = false;
    for (const auto& add : nodeRenderers_) any = add(renderer) || any;
    return any;
}

Result<> Extensions::attachSubscribers(Scene& scene, Attached& attached) const {
    Result<> first;
    const auto note = [&](std::string_view why) {
        if (first) first = fail(fmt::format("a subscriber of a plug-in cannot be made: {}", why));
    };
    for (const SubscriberMaker& make : subscribers_) {
        try {
            std::unique_ptr<Subscriber> subscriber = make(scene);
            if (!subscriber) continue;
            Attachment attachment = scene.bus().attach(*subscriber);
            attached.all_.emplace_back(std::move(subscriber), std::move(attachment));
        } catch (const std::exception& e) {
            note(e.what());
        } catch (...) {
            note("it says not why");
        }
    }
    return first;
}

}  // namespace rtsg
