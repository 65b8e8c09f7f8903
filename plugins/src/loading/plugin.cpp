// Loads plug-ins, and hands what they have added to scenes, worlds and renderers.
#include <rtsg/plugins/plugin.h>

#include <exception>
#include <string_view>
#include <system_error>

#include <dlfcn.h>

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

void Extensions::add(FormatReader reader) {
    withMore(dialect_, std::move(reader));
}

void Extensions::add(FormatWriter writer) {
    withMore(dialect_, std::move(writer));
}

Result<> Extensions::add(std::shared_ptr<const NodeType> type) {
    return withMore(dialect_, std::move(type));
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

namespace {

/// Why the system does not load it, without the file's name, which the message has already.
std::string loadFailure(const std::string& file) {
    const char* text = ::dlerror();
    std::string_view why = text ? text : "no reason is given";
    if (why.starts_with(file + ": ")) why.remove_prefix(file.size() + 2);
    return std::string(why);
}

Result<> addFrom(const PluginEntry& entry, Extensions& extensions) {
    Extensions more = extensions;  // so that nothing is added by halves
    const auto fieldTypes = fieldTypeRegistry();
    const auto added = [&]() -> Result<> {
        try {
            return entry.add(more);
        } catch (const std::exception& e) {
            return fail(fmt::format("it failed: {}", e.what()));
        } catch (...) {
            return fail("it failed, and says not why");
        }
    }();
    if (added)
        extensions = std::move(more);
    else
        restoreFieldTypes(fieldTypes);
    return added;
}

/// Precondition: `path` has a slash, or the system would look for it elsewhere.
Result<> loadFrom(const std::string& path, Extensions& extensions) {
    void* const library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!library) return fail(fmt::format("it cannot be loaded: {}", loadFailure(path)));
    void* const found = ::dlsym(library, kPluginFunction);
    if (!found) return fail(fmt::format("it is no plug-in: it has no function {}", kPluginFunction));
    const PluginEntry* entry = nullptr;
    try {
        entry = reinterpret_cast<const PluginEntry* (*)()>(found)();
    } catch (...) {
        return fail(fmt::format("it is no plug-in: its {} throws", kPluginFunction));
    }
    if (!entry || !entry->version) return fail(fmt::format("its {} returns nothing", kPluginFunction));
    if (std::string_view(entry->version) != kPluginVersion)
        return fail(fmt::format("it was built with version {}, and this is {}", entry->version, kPluginVersion));
    if (entry->size != sizeof(PluginEntry) || !entry->add) return fail("it is of another version");
    return addFrom(*entry, extensions);
}

}  // namespace

Result<> loadPlugin(const std::filesystem::path& file, Extensions& extensions) {
    std::error_code error;
    const std::filesystem::path path = std::filesystem::canonical(file, error);
    const auto named = [&](Result<> result) -> Result<> {
        if (!result) return fail(DiagnosticCode("plug-in"), result.error().text, {}, file.string());
        return result;
    };
    if (error) return named(fail(fmt::format("it cannot be loaded: {}", error.message())));
    return named(loadFrom(path.string(), extensions));
}

}  // namespace rtsg
