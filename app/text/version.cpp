// The output of `rtsg --version --json`: the version, the commit, the available parts, and the libraries that they use.
#include "version.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <ranges>
#include <string_view>
#include <vector>

#include <dlfcn.h>
#include <fmt/format.h>
#include <link.h>
#include <rtsg/core/machine.h>

namespace rtsg::app {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> parts(std::string_view list) {
    std::vector<std::string> result;
    for (const auto part : list | std::views::split(','))
        if (!part.empty()) result.emplace_back(part.begin(), part.end());
    return result;
}

/// The files of all that is loaded, links resolved: their names end with the version.
std::vector<fs::path> loadedFiles() {
    std::vector<fs::path> files;
    ::dl_iterate_phdr(
        [](dl_phdr_info* info, std::size_t, void* to) {
            std::error_code error;
            if (fs::path file = fs::canonical(info->dlpi_name, error); !error)
                static_cast<std::vector<fs::path>*>(to)->push_back(std::move(file));
            return 0;
        },
        &files);
    return files;
}

/// "libode.so.8.2.2" is 8.2.2 of libode. The program's own, and the C library's, which have no such name, are none.
std::map<std::string, std::string> librariesOf(const std::vector<fs::path>& files) {
    std::map<std::string, std::string> result;
    for (const fs::path& file : files) {
        const std::string name = file.filename();
        const std::size_t end = name.find(".so.");
        if (end == name.npos || name.starts_with("librtsg_")) continue;
        result[name.substr(0, end)] = name.substr(end + 4);
    }
    return result;
}

/// The processor level that the libraries were compiled for: for installed ones the loader may choose those for newer
/// processors.
std::string compiledFor(const std::vector<fs::path>& files) {
    for (const fs::path& file : files)
        if (const std::string name = file.filename(); name.starts_with("librtsg_core.so"))
            if (const fs::path folder = file.parent_path(); folder.parent_path().filename() == "glibc-hwcaps")
                return folder.filename();
#if defined(__x86_64__) && defined(__AVX2__)
    return "x86-64-v3";
#elif defined(__x86_64__)
    return "x86-64";
#else
    return RTSG_PROCESSOR;
#endif
}

bool loads(const std::string& module) {
    return ::dlopen(fmt::format("librtsg_{}.so", module).c_str(), RTLD_NOW | RTLD_LOCAL) != nullptr;
}

template <class Pairs>
std::string object(const Pairs& pairs, auto print) {
    std::string text;
    for (const auto& [name, value] : pairs)
        text += fmt::format("{}\"{}\":{}", text.empty() ? "" : ",", name, print(value));
    return "{" + text + "}";
}

}  // namespace

std::string versionAsJson() {
    std::map<std::string, bool> modules;
    for (const std::string& module : parts(RTSG_DELAYED)) modules[module] = loads(module);
    // The rest drags some hundred libraries along, whose versions nobody asks for.
    const std::vector<fs::path> files = loadedFiles();
    for (const std::string& module : parts(RTSG_MODULES))
        modules.try_emplace(module, false).first->second = loads(module);
    std::map<std::string, bool> features;
    for (const std::string& feature : parts(RTSG_FEATURES)) features[feature] = true;
    for (const std::string& feature : parts(RTSG_LEFT_OUT)) features[feature] = false;
    const auto truth = [](bool value) { return value ? "true" : "false"; };
    const auto text = [](const std::string& value) { return fmt::format("\"{}\"", value); };
    return fmt::format(
        "{{\"version\":\"{}\",\"commit\":\"{}\",\"compiler\":\"{}\",\"features\":{},\"modules\":{},"
        "\"kernels\":{{\"compiled_for\":\"{}\",\"avx512\":{}}},\"libraries\":{}}}",
        RTSG_VERSION, RTSG_COMMIT, RTSG_COMPILER, object(features, truth), object(modules, truth), compiledFor(files),
        truth(simd::hasAvx512()), object(librariesOf(files), text));
}

}  // namespace rtsg::app
