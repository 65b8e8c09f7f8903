// Loads plug-ins: looks at their files first, and takes nothing from one that fails.
#include <rtsg/plugins/plugin.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>

#include <dlfcn.h>

#include <fmt/format.h>

namespace rtsg {

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
            auto ok = entry.add(more);
            return ok ? more.added() : ok;
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

/// What a file says of the headers that it was compiled with; empty if it says nothing.
std::string interfaceOf(const std::string& path) {
    constexpr std::string_view kOurs = RTSG_PLUGIN_INTERFACE;
    constexpr std::string_view kOpening = kOurs.substr(0, kOurs.find(RTSG_PLUGIN_HEADERS));
    constexpr std::uintmax_t kMaxBytes = 1 << 30;
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    std::string bytes(error ? 0 : std::min(size, kMaxBytes), '\0');
    std::ifstream(path, std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    const std::size_t opening = bytes.find(kOpening);
    if (opening == bytes.npos) return {};
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(opening + kOpening.size());
    return {begin, std::find_if(begin, bytes.end(), [](char c) { return c < ' ' || c > '~'; })};
}

/// Asks the file, as nothing of a library that does not fit may run, and the system would only name what it misses.
Result<> checkInterface(const std::string& path) {
    constexpr std::string_view kOurs = RTSG_PLUGIN_HEADERS RTSG_PLUGIN_LIBRARY;
    const std::string theirs = interfaceOf(path);
    if (theirs.empty())
        return fail(
            fmt::format("it is no plug-in, or an old one: it does not say that it was compiled with the headers of "
                        "this program ({})",
                        kOurs));
    if (theirs != kOurs)
        return fail(fmt::format("it was compiled with other headers ({}) than this program ({}): compile it again",
                                theirs, kOurs));
    return {};
}

/// Precondition: `path` has a slash, or the system would look for it elsewhere.
Result<> loadFrom(const std::string& path, Extensions& extensions) {
    if (auto ok = checkInterface(path); !ok) return ok;
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
    if (!entry || !entry->add) return fail(fmt::format("its {} returns nothing", kPluginFunction));
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
    if (!error && !std::filesystem::is_regular_file(path, error) && !error)
        return named(fail("it cannot be loaded: it is no regular file"));
    if (error) return named(fail(fmt::format("it cannot be loaded: {}", error.message())));
    return named(loadFrom(path.string(), extensions));
}

}  // namespace rtsg
