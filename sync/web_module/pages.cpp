// Finds files of the page by the names in requests.
#include "pages.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <utility>

#include <sys/stat.h>
#include <zlib.h>

namespace rtsg::web {

namespace {

constexpr std::size_t kLongestTarget = 200;
constexpr std::uintmax_t kLargestFile = std::uintmax_t{32} << 20;
constexpr std::array<std::string_view, 4> kFolders = {"page/", "src/", "node_modules/hash-wasm/dist/",
                                                      "node_modules/x_ite/dist/"};
constexpr std::array<std::pair<std::string_view, std::string_view>, 14> kTypes = {{
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".mjs", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".json", "application/json"},
    {".wasm", "application/wasm"},
    {".png", "image/png"},
    {".jpg", "image/jpeg"},
    {".svg", "image/svg+xml"},
    {".ico", "image/x-icon"},
    {".woff2", "font/woff2"},
    {".ttf", "font/ttf"},
    {".xml", "application/xml"},
    {".webp", "image/webp"},
}};

bool isPlain(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' ||
           c == '.' || c == '/';
}

std::string_view typeOf(std::string_view name) {
    for (const auto& [ending, type] : kTypes)
        if (name.ends_with(ending)) return type;
    return {};
}

}  // namespace

std::optional<PageFile> findPage(const std::string& folder, std::string_view target) {
    if (target.empty() || target.front() != '/' || target.size() > kLongestTarget) return std::nullopt;
    std::string_view name = target.substr(1);
    if (name.empty()) name = "page/index.html";
    const bool plain = std::ranges::all_of(name, isPlain) && name.front() != '.' &&
                       name.find("/.") == std::string_view::npos && name.find("//") == std::string_view::npos;
    const bool below = std::ranges::any_of(kFolders, [name](std::string_view f) { return name.starts_with(f); });
    const std::string_view type = typeOf(name);
    if (!plain || !below || type.empty()) return std::nullopt;
    PageFile file{folder + "/" + std::string(name), type, {}};
    struct stat about{};
    if (::stat(file.path.c_str(), &about) != 0 || !S_ISREG(about.st_mode)) return std::nullopt;
    if (static_cast<std::uintmax_t>(about.st_size) > kLargestFile) return std::nullopt;
    file.tag = '"' + std::to_string(about.st_size) + "-" + std::to_string(about.st_mtim.tv_sec) + "-" +
               std::to_string(about.st_mtim.tv_nsec) + '"';
    return file;
}

std::optional<std::string> readPage(const PageFile& file) {
    std::ifstream in(file.path, std::ios::binary);
    if (!in) return std::nullopt;
    std::string text{std::istreambuf_iterator<char>(in), {}};
    if (in.bad()) return std::nullopt;
    return text;
}

bool isWorthPacking(const PageFile& file) {
    return file.type.starts_with("text/") || file.type == "application/wasm" || file.type == "application/json";
}

std::string packed(const std::string& text) {
    constexpr int kLevel = 6, kGzip = 15 + 16, kMemory = 8;
    z_stream stream{};
    if (deflateInit2(&stream, kLevel, Z_DEFLATED, kGzip, kMemory, Z_DEFAULT_STRATEGY) != Z_OK) return {};
    std::string result(deflateBound(&stream, static_cast<uLong>(text.size())), '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = static_cast<uInt>(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(result.data());
    stream.avail_out = static_cast<uInt>(result.size());
    const bool whole = deflate(&stream, Z_FINISH) == Z_STREAM_END;
    result.resize(whole ? stream.total_out : 0);
    deflateEnd(&stream);
    return result;
}

}  // namespace rtsg::web
