// Decides what the urls of a scene may open, by one rule for Inline, EXTERNPROTO, Script, textures and sounds.
//
// A relative url starts from the folder of the document that holds it. Whoever loads a document into an Inline or an
// EXTERNPROTO instance leaves the url that led to it in the hidden field `loadedUrl` of that node, so the folder is
// found from the scene alone, by walking out through the scopes: a replica finds the same one below its own base
// folder. A url handed into a PROTO by IS starts from the document of the instance, then from that of the PROTO.
// Regular files below one of the policy's roots are opened, and `data:`; `package:` urls, which robots' files have,
// name files in folders that the user gave names. What was opened is what is checked, so neither `..`, nor a symbolic
// link, nor a swap between check and opening leads out. A folder may be an http(s) address: urls from there lead to
// addresses and never to files. Addresses are for the policy's fetcher; without one they are refused. Threading:
// values; all calls are const. Source: RFC 3986, RFC 8089, RFC 2397; 19775-1 V4.0 9.2.1.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/node_type.h>

namespace rtsg {

class Node;
class Scene;
class UrlFetcher;

struct ResourcePolicy {
    /// Regular files in these folders and below may be opened. None: no file at all.
    std::vector<std::filesystem::path> roots;
    /// Folders of packages by their names: `package://NAME/a.stl` is a.stl in that of NAME, which is a root, too.
    std::vector<std::pair<std::string, std::filesystem::path>> packages{};
    std::uint64_t maximumBytes = std::uint64_t{1} << 30;    // of one file that a url names
    std::uint64_t maximumPixels = std::uint64_t{1} << 28;   // of all pictures of a scene at once; one may have a fourth
    std::uint64_t maximumSamples = std::uint64_t{1} << 28;  // of all sounds of a scene at once, all channels
    std::uint64_t maximumNodes = 5'000'000;                 // in Inlines and PROTO bodies, which may repeat without end
    std::uint64_t maximumInstances = 2'000'000;             // shapes and the like, one per path from the root
    std::uint64_t maximumDepth = 32;                        // of documents within documents
    std::uint64_t maximumSeconds = 600;                     // of reading a document with all that it inlines
    std::shared_ptr<UrlFetcher> fetcher{};                  // of http and https; null: nothing is fetched
};

/// A regular file, opened and checked, what was fetched from an address, or the content of a `data:` url. Move only.
class Resource {
  public:
    Resource(Resource&& other) noexcept;
    Resource& operator=(Resource&& other) noexcept;
    ~Resource();

    /// The real path, links resolved; the address that answered; empty for a `data:` url.
    const std::filesystem::path& path() const { return path_; }
    /// For diagnostics: the path, the address, or the head of a `data:` url.
    const std::string& name() const { return name_; }
    /// The media type of a `data:` url, such as image/png, or the one that a server states.
    const std::string& mediaType() const { return mediaType_; }
    /// What follows `#`, decoded.
    const std::string& fragment() const { return fragment_; }
    /// The content; once. Errors: more bytes than the policy lets, or than the process may hold (memory.h), or what the
    /// system says.
    Result<std::string> read();
    /// The open file, which stays this object's, for who reads it piece by piece; -1 for a `data:` url.
    int descriptor() const { return descriptor_; }
    /// Bytes there are; 0 after read().
    std::uint64_t size() const;
    /// `length` bytes from `offset` on; fewer at the end, after an error, and after read(). Leaves read() as it is.
    std::string readAt(std::uint64_t offset, std::size_t length) const;

  private:
    friend class Resources;
    Resource() = default;

    int descriptor_ = -1;
    std::filesystem::path path_;
    std::string name_, mediaType_, fragment_, data_;
    std::uint64_t limit_ = 0;
};

class Resources {
  public:
    /// Nothing but `data:` urls.
    Resources() = default;
    /// Opens what is below `folder`, from which relative urls start. An empty one is the same as no argument.
    Resources(const std::filesystem::path& folder);  // NOLINT(google-explicit-constructor): a folder says it all
    /// `folder` is only where relative urls start; what may be opened is up to the policy.
    Resources(const std::filesystem::path& folder, ResourcePolicy policy);
    /// For a document that the user named: what is below its own folder and below the working folder. "-" has no folder
    /// but the working folder. An address has no files.
    static Resources ofFile(const std::filesystem::path& file, ResourcePolicy policy = {});

    const std::filesystem::path& folder() const { return folder_; }
    const ResourcePolicy& policy() const { return policy_; }

    /// `from`: the folder of the document that holds the url. Errors: a sentence that says why, and which --allow
    /// helps.
    Result<Resource> open(const std::filesystem::path& from, std::string_view url) const;
    /// Opens a url that stands in `field` of a node.
    Result<Resource> open(const Scene& scene, const Node& node, FieldIndex field, std::string_view url) const;
    /// Starts to fetch what open() would wait for. True as long as it would wait; false for files, and for what has
    /// come or cannot come.
    bool awaits(const std::filesystem::path& from, std::string_view url) const;
    bool awaits(const Scene& scene, const Node& node, FieldIndex field, std::string_view url) const;
    /// The same, but that addresses are refused.
    Resources withoutNetwork() const;

    /// The folders from which relative urls of a node's `field` start: one, or several to be tried in turn for a url
    /// that came by IS.
    std::vector<std::filesystem::path> foldersOf(const Scene& scene, const Node& node, FieldIndex field) const;
    /// The folder of the document whose nodes have this scope.
    std::filesystem::path folderOf(const Scene& scene, NodeId scope) const;
    /// Looks for the folder of the document behind a url that has been opened. For what came from an address, give
    /// that.
    std::filesystem::path folderBehind(const std::filesystem::path& from, std::string_view url) const;

  private:
    std::optional<Result<std::string>> addressOf(const std::filesystem::path& from, std::string_view url) const;
    Result<Resource> openAddress(const std::string& address, std::string_view shown) const;
    Result<std::filesystem::path> pathOf(std::string_view package, const std::string& path, std::string_view url) const;
    Result<std::filesystem::path> locate(const std::filesystem::path& from, std::string_view path,
                                         std::string_view url) const;
    bool allows(const std::filesystem::path& file) const;

    std::filesystem::path folder_;
    ResourcePolicy policy_;
    std::vector<std::filesystem::path> real_;  // the roots, links resolved
};

/// `inner`, which stands in the document behind `outer`, as seen from where `outer` stands. Without its fragment.
std::string joinUrls(std::string_view outer, std::string_view inner);
/// What follows `#`, decoded.
std::string urlFragment(std::string_view url);
/// Writes a url short enough for a message.
std::string urlForMessage(std::string_view url);

}  // namespace rtsg
