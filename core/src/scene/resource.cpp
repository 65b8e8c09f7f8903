// Opens urls, or says why not; and finds the folder from which a node's urls start.
#include <rtsg/core/resource.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include <rtsg/core/descriptor.h>
#include <rtsg/core/machine.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/url_fetcher.h>
#include <rtsg/core/web_address.h>
#include <rtsg/core/x3d.h>

#include "resource_url.h"
#include "value/read_descriptor.h"

namespace rtsg {

namespace {

/// An IS chain, or scopes within scopes, longer than any document makes: a forged circle.
constexpr int kMaxSteps = 256;

bool isBelow(const std::filesystem::path& file, const std::filesystem::path& folder) {
    return std::ranges::mismatch(folder, file).in1 == folder.end();
}

std::filesystem::path withoutSlash(const std::filesystem::path& folder) {
    return folder.has_filename() || !folder.has_relative_path() ? folder : folder.parent_path();
}

bool isAddress(const std::filesystem::path& folder) {
    return isWebAddress(folder.native());
}

/// The address from which urls of documents in this folder start.
Result<WebAddress> baseOf(const std::filesystem::path& folder) {
    const std::string& text = folder.native();
    return WebAddress::parse(text.ends_with('/') ? text : text + '/');
}

/// Without the slash at its end, as other folders.
std::filesystem::path folderOfAddress(const WebAddress& address) {
    const std::string text = WebAddress{address.isSecure, address.host, address.port, {}}.text();
    const std::string path = address.path.substr(0, address.path.find('?'));
    return text + path.substr(0, path.rfind('/'));
}

std::filesystem::path realFolder(const std::filesystem::path& folder) {
    if (isAddress(folder)) {
        const auto base = baseOf(folder);
        return base ? folderOfAddress(*base) : std::filesystem::path();
    }
    std::error_code problem;
    auto real = std::filesystem::weakly_canonical(std::filesystem::absolute(folder, problem), problem);
    return problem ? std::filesystem::path() : withoutSlash(real);
}

const char* kindOf(mode_t mode) {
    if (S_ISDIR(mode)) return "a folder";
    if (S_ISCHR(mode) || S_ISBLK(mode)) return "a device";
    if (S_ISFIFO(mode)) return "a pipe";
    if (S_ISSOCK(mode)) return "a socket";
    return "something else";
}

std::string hiddenText(const Node& node, std::string_view name) {
    const FieldIndex field = node.type().findExact(name);
    if (field == kNoField || !node.type().fields[field].hidden || node.type().fields[field].type != FieldType::SFString)
        return {};
    return static_cast<const String*>(node.storage(field))->str();
}

}  // namespace

// ---- Resource --------------------------------------------------------------------------------------------------

Resource::Resource(Resource&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      path_(std::move(other.path_)),
      name_(std::move(other.name_)),
      mediaType_(std::move(other.mediaType_)),
      fragment_(std::move(other.fragment_)),
      data_(std::move(other.data_)),
      limit_(other.limit_) {}

Resource& Resource::operator=(Resource&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    path_ = std::move(other.path_);
    name_ = std::move(other.name_);
    mediaType_ = std::move(other.mediaType_);
    fragment_ = std::move(other.fragment_);
    data_ = std::move(other.data_);
    limit_ = other.limit_;
    return *this;
}

Resource::~Resource() {
    if (descriptor_ >= 0) ::close(descriptor_);
}

Result<std::string> Resource::read() {
    if (descriptor_ < 0) return std::move(data_);
    if (auto ok = mayHold(size()); !ok) return fail(ok.error().code, fmt::format("{}: {}", name_, ok.error().text));
    auto text = detail::readDescriptor(descriptor_, limit_);
    ::close(std::exchange(descriptor_, -1));
    if (!text) return fail(fmt::format("{}: {}", name_, text.error().text));
    return text;
}

std::uint64_t Resource::size() const {
    struct stat status{};
    if (descriptor_ < 0) return data_.size();
    return ::fstat(descriptor_, &status) == 0 && status.st_size > 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

std::string Resource::readAt(std::uint64_t offset, std::size_t length) const {
    if (descriptor_ < 0) return offset < data_.size() ? data_.substr(offset, length) : std::string();
    const std::uint64_t there = size();
    if (offset >= there) return {};
    std::string bytes(static_cast<std::size_t>(std::min<std::uint64_t>(length, there - offset)), '\0');
    std::size_t got = 0;
    while (got < bytes.size()) {
        const ssize_t more =
            ::pread(descriptor_, bytes.data() + got, bytes.size() - got, static_cast<off_t>(offset + got));
        if (more < 0 && errno == EINTR) continue;
        if (more <= 0) break;
        got += static_cast<std::size_t>(more);
    }
    bytes.resize(got);
    return bytes;
}

// ---- Resources -------------------------------------------------------------------------------------------------

Resources::Resources(const std::filesystem::path& folder) {
    if (folder.empty()) return;
    policy_.roots = {folder};
    *this = Resources(folder, std::move(policy_));
}

Resources::Resources(const std::filesystem::path& folder, ResourcePolicy policy) : policy_(std::move(policy)) {
    if (!folder.empty()) folder_ = realFolder(folder);
    for (const auto& [name, descriptor] : policy_.packages)
        if (std::ranges::find(policy_.roots, descriptor) == policy_.roots.end()) policy_.roots.push_back(descriptor);
    for (const auto& root : policy_.roots) real_.push_back(realFolder(root));
    std::erase_if(real_, [](const auto& root) { return root.empty(); });
}

Resources Resources::ofFile(const std::filesystem::path& file, ResourcePolicy policy) {
    if (isAddress(file)) return {Resources({}, policy).folderBehind({}, file.native()), std::move(policy)};
    std::filesystem::path folder = file.parent_path();
    if (folder.empty()) folder = ".";
    policy.roots.push_back(folder);
    policy.roots.emplace_back(".");
    return {folder, std::move(policy)};
}

bool Resources::allows(const std::filesystem::path& file) const {
    return std::ranges::any_of(real_, [&](const auto& root) { return isBelow(file, root); });
}

Result<std::filesystem::path> Resources::locate(const std::filesystem::path& from, std::string_view path,
                                                std::string_view url) const {
    if (path.empty()) return fail(fmt::format("'{}' names no file", url));
    if (path.find('\0') != path.npos) return fail(fmt::format("'{}' holds a zero byte", url));
    const std::filesystem::path named(path);
    if (named.is_relative() && from.empty())
        return fail(fmt::format("'{}' is relative, and nothing says to which folder; --base does", url));
    std::filesystem::path full = named.is_absolute() ? named : from / named;
    // A file that is outside by its name alone is not touched; where links lead shows once a file is opened.
    const auto normal = full.lexically_normal();
    const bool inside =
        allows(normal) || std::ranges::any_of(policy_.roots, [&](const auto& root) {
            std::error_code ignored;
            return isBelow(normal, withoutSlash(std::filesystem::absolute(root, ignored).lexically_normal()));
        });
    if (!inside)
        return fail(fmt::format("'{}' is outside the folders that may be opened; --allow {} opens them to it", url,
                                normal.parent_path().string()));
    return full;
}

// ---- addresses -------------------------------------------------------------------------------------------------

/// The address that a url leads to; nothing for a file or a `data:` url. Error: it is none, or leads from the network
/// to files.
std::optional<Result<std::string>> Resources::addressOf(const std::filesystem::path& from, std::string_view url) const {
    using Kind = detail::UrlParts::Kind;
    const detail::UrlParts parts = detail::splitUrl(url);
    const std::string shown = urlForMessage(url);
    const bool isRelative = parts.kind == Kind::file && !parts.hasScheme && isAddress(from);
    if (parts.kind != Kind::web && !isRelative) {
        if ((parts.kind == Kind::file || parts.kind == Kind::package) && isAddress(from))
            return fail(fmt::format("'{}' is a file, and the document that names it is on the network", shown));
        return std::nullopt;
    }
    if (isRelative && parts.encoded.empty()) return fail(fmt::format("'{}' names no file", shown));
    const auto base = isRelative ? baseOf(from) : WebAddress::parse(url);
    const auto address = base && isRelative ? base->resolve(parts.encoded) : base;
    if (!address) return fail(fmt::format("'{}' is no address: {}", shown, address.error().text));
    return address->text();
}

Result<Resource> Resources::openAddress(const std::string& address, std::string_view shown) const {
    if (!policy_.fetcher)
        return fail(fmt::format("'{}' is not a local file, and nothing is fetched from a network", shown));
    auto content = policy_.fetcher->fetch(address, policy_.maximumBytes);
    if (!content) return fail(content.error().code, fmt::format("'{}': {}", shown, content.error().text));
    Resource resource;
    resource.descriptor_ = content->descriptor;
    resource.path_ = content->address;
    resource.name_ = std::move(content->address);
    resource.mediaType_ = std::move(content->mediaType);
    resource.limit_ = policy_.maximumBytes;
    return resource;
}

bool Resources::awaits(const std::filesystem::path& from, std::string_view url) const {
    if (!policy_.fetcher) return false;
    const auto address = addressOf(from, url);
    return address && *address && policy_.fetcher->awaits(**address, policy_.maximumBytes);
}

bool Resources::awaits(const Scene& scene, const Node& node, FieldIndex field, std::string_view url) const {
    return policy_.fetcher &&
           std::ranges::any_of(foldersOf(scene, node, field), [&](const auto& folder) { return awaits(folder, url); });
}

Resources Resources::withoutNetwork() const {
    Resources result = *this;
    result.policy_.fetcher = nullptr;
    return result;
}

/// The path of a file in a package.
Result<std::filesystem::path> Resources::pathOf(std::string_view package, const std::string& path,
                                                std::string_view url) const {
    const auto found =
        std::ranges::find(policy_.packages, package, [](const auto& one) -> std::string_view { return one.first; });
    if (found == policy_.packages.end())
        return fail(
            fmt::format("'{}': nothing says where the package {} is; --package {}=FOLDER does", url, package, package));
    std::error_code ignored;
    return std::filesystem::absolute(found->second, ignored).concat("/" + path);
}

// ---- opening ---------------------------------------------------------------------------------------------------

Result<Resource> Resources::open(const std::filesystem::path& from, std::string_view url) const {
    if (const auto address = addressOf(from, url)) {
        if (!*address) return std::unexpected(address->error());
        auto fetched = openAddress(**address, urlForMessage(url));
        if (fetched) fetched->fragment_ = urlFragment(url);
        return fetched;
    }
    detail::UrlParts parts = detail::splitUrl(url);
    const std::string shown = urlForMessage(url);
    Resource resource;
    resource.fragment_ = std::move(parts.fragment);
    resource.limit_ = policy_.maximumBytes;
    if (parts.kind == detail::UrlParts::Kind::data) {
        // Decoded twice, by percent signs and by base64; the second is shorter.
        if (auto ok = mayHold(2 * url.size()); !ok)
            return fail(ok.error().code, fmt::format("'{}': {}", shown, ok.error().text));
        auto data = detail::decodeDataUrl(url);
        if (!data) return fail(fmt::format("'{}' is no well-formed data: url", shown));
        if (data->bytes.size() > policy_.maximumBytes)
            return fail(
                fmt::format("'{}' has more than {} bytes; --limit bytes=N raises this", shown, policy_.maximumBytes));
        resource.name_ = "data:" + data->mediaType;
        resource.mediaType_ = std::move(data->mediaType);
        resource.data_ = std::move(data->bytes);
        return resource;
    }
    if (parts.kind == detail::UrlParts::Kind::package) {
        auto path = pathOf(parts.package, parts.path, shown);
        if (!path) return std::unexpected(path.error());
        parts.path = path->string();
    }
    if (parts.kind == detail::UrlParts::Kind::other)
        return fail(fmt::format("'{}' is not a local file, and nothing is fetched from a network", shown));
    const auto full = locate(from, parts.path, shown);
    if (!full) return std::unexpected(full.error());

    // First without opening it in earnest: a device acts, and a pipe waits, when it is opened.
    const Descriptor descriptor(::open(full->c_str(), O_PATH | O_CLOEXEC));
    if (!descriptor) {
        if (errno == ENOENT || errno == ENOTDIR)
            return fail(fmt::format("'{}' is not there (looked for {})", shown, full->string()));
        return fail(fmt::format("'{}' cannot be opened: {}", shown, std::strerror(errno)));
    }
    struct stat status{};
    if (fstat(descriptor.get(), &status) != 0) return fail(fmt::format("'{}': {}", shown, std::strerror(errno)));
    const std::string handle = fmt::format("/proc/self/fd/{}", descriptor.get());
    std::error_code problem;
    resource.path_ = std::filesystem::read_symlink(handle, problem);
    if (problem) return fail(fmt::format("'{}' is not opened: without /proc it is not known where it is", shown));
    if (!allows(resource.path_))
        return fail(fmt::format("'{}' leads to {}, outside the folders that may be opened; --allow {} opens them to it",
                                shown, resource.path_.string(), resource.path_.parent_path().string()));
    if (!S_ISREG(status.st_mode)) return fail(fmt::format("'{}' is {}, not a file", shown, kindOf(status.st_mode)));
    if (static_cast<std::uint64_t>(status.st_size) > policy_.maximumBytes)
        return fail(
            fmt::format("'{}' has more than {} bytes; --limit bytes=N raises this", shown, policy_.maximumBytes));
    resource.descriptor_ = ::open(handle.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (resource.descriptor_ < 0) return fail(fmt::format("'{}' cannot be opened: {}", shown, std::strerror(errno)));
    resource.name_ = resource.path_.string();
    return resource;
}

Result<Resource> Resources::open(const Scene& scene, const Node& node, FieldIndex field, std::string_view url) const {
    Result<Resource> first = fail({});
    bool tried = false;
    for (const auto& folder : foldersOf(scene, node, field)) {
        auto resource = open(folder, url);
        if (resource) return resource;
        if (!std::exchange(tried, true)) first = std::move(resource);
    }
    return first;
}

// ---- folders of documents ---------------------------------------------------------------------------------------

std::filesystem::path Resources::folderBehind(const std::filesystem::path& from, std::string_view url) const {
    const detail::UrlParts parts = detail::splitUrl(url);
    if (parts.kind == detail::UrlParts::Kind::web) {
        const auto address = WebAddress::parse(url);
        return address ? folderOfAddress(*address) : std::filesystem::path();
    }
    if (parts.kind == detail::UrlParts::Kind::package) {
        const auto path = pathOf(parts.package, parts.path, url);
        return path ? path->parent_path() : std::filesystem::path();
    }
    if (parts.kind != detail::UrlParts::Kind::file) return {};
    if (isAddress(from)) {
        const auto base = baseOf(from);
        const auto address = base && !parts.hasScheme ? base->resolve(parts.encoded) : base;
        return address && !parts.hasScheme ? folderOfAddress(*address) : std::filesystem::path();
    }
    const std::filesystem::path path(parts.path);
    if (path.is_absolute()) return path.parent_path();
    return from.empty() ? std::filesystem::path() : withoutSlash(from / path.parent_path());
}

std::filesystem::path Resources::folderOf(const Scene& scene, NodeId scope) const {
    std::vector<std::string> urls;  // innermost first
    const Node* node = scene.find(scope);
    for (int steps = 0; node && steps < kMaxSteps; ++steps, node = scene.find(node->scope()))
        if (std::string url = hiddenText(*node, "loadedUrl"); !url.empty()) urls.push_back(std::move(url));
    // A document that came from the network itself says so, also to those who follow its scene elsewhere.
    if (std::string url = scene.node(scene.root()).get(x3d::RtsgScene::loadedUrl).str(); !url.empty())
        urls.push_back(std::move(url));
    std::filesystem::path folder = folder_;
    for (auto url = urls.rbegin(); url != urls.rend(); ++url) folder = folderBehind(folder, *url);
    return folder;
}

std::vector<std::filesystem::path> Resources::foldersOf(const Scene& scene, const Node& node, FieldIndex field) const {
    std::vector<std::filesystem::path> folders{folderOf(scene, node.scope())};
    const Node* at = &node;
    for (int steps = 0; at && steps < kMaxSteps; ++steps) {
        const auto routes = scene.routesTo(at->id());
        // An IS connection of inputOutput fields has two directions: takes the one that comes from the instance around
        // the node.
        const auto from = std::ranges::find_if(
            routes, [&](const Route& r) { return r.isConnection && r.toField == field && r.fromNode == at->scope(); });
        if (from == routes.end()) break;
        at = scene.find(from->fromNode);
        field = from->fromField;
        if (!at) break;
        if (auto folder = folderOf(scene, at->scope()); folder != folders.front())
            folders.insert(folders.begin(), std::move(folder));
    }
    return folders;
}

}  // namespace rtsg
