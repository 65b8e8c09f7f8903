// Decides which files and addresses the urls of a scene may open, by one rule for Inline, EXTERNPROTO, Script, textures
// and sounds.
//
// A relative url starts from the folder of the document that holds it. Code that loads a document into an Inline or an
// EXTERNPROTO instance leaves its url in the hidden field `loadedUrl` of that node. So the folder follows from the
// scene alone, by walking out through the scopes, and a replica finds it below its own base folder. A url that enters a
// PROTO by IS starts from the document of the instance, then from that of the PROTO. Allowed are `data:` urls, regular
// files below one of the policy's roots, and `package:` urls (of robots' files), which name files in folders that the
// user gave names. The check looks at the opened file, so `..`, symbolic links or a swap after a check do not lead out.
// A folder may be an http(s) address: urls from there lead to addresses and never to files. Addresses need the policy's
// fetcher and are refused without one. Threading: values; all calls are const. Source: RFC 3986, RFC 8089, RFC 2397;
// 19775-1 V4.0 9.2.1.
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
    /// Regular files in and below these folders may be opened; if there are none, no files.
    std::vector<std::filesystem::path> roots;
    /// Folders of packages by name: `package://NAME/a.stl` is a.stl in the folder of NAME, which counts as a root, too.
    std::vector<std::pair<std::string, std::filesystem::path>> packages{};
    std::uint64_t maximumBytes = std::uint64_t{1} << 30;    // of one file that a url names
    std::uint64_t maximumPixels = std::uint64_t{1} << 28;   // of all pictures of a scene together; one picture may have
                                                            // a fourth of it
    std::uint64_t maximumSamples = std::uint64_t{1} << 28;  // of all sounds of a scene together, all channels
    std::uint64_t maximumNodes = 5'000'000;                 // in Inlines and PROTO bodies, which could repeat without
                                                            // end
    std::uint64_t maximumInstances = 2'000'000;             // shapes and the like, one for each path from the root
    std::uint64_t maximumDepth = 32;                        // of documents within documents
    std::uint64_t maximumSeconds = 600;                     // for reading a document with all its Inlines
    std::shared_ptr<UrlFetcher> fetcher{};                  // for http and https; null: nothing is fetched
};

/// The content behind a url: a checked regular file, a file fetched from an address, or a `data:` url. Move only.
class Resource {
  public:
    Resource(Resource&& other) noexcept;
    Resource& operator=(Resource&& other) noexcept;
    ~Resource();

    /// The real path with links resolved, or the address that answered; empty for a `data:` url.
    const std::filesystem::path& path() const { return path_; }
    /// For diagnostics: the path, the address, or the head of a `data:` url.
    const std::string& name() const { return name_; }
    /// The media type of a `data:` url, such as image/png, or the one that a server states.
    const std::string& mediaType() const { return mediaType_; }
    /// The text after `#`, decoded.
    const std::string& fragment() const { return fragment_; }
    /// Returns the content; call it once. Errors: more bytes than the policy or the process's limit (machine.h) allows;
    /// what the system reports.
    Result<std::string> read();
    /// The open file, for reading it in pieces; this object keeps it. -1 for a `data:` url.
    int descriptor() const { return descriptor_; }
    /// The number of bytes; 0 after read().
    std::uint64_t size() const;
    /// Reads `length` bytes from `offset` on; fewer at the end, after an error, and after read(). read() still works
    /// later.
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
    /// Opens nothing but `data:` urls.
    Resources() = default;
    /// Opens files below `folder`, where relative urls start. An empty path is the same as no argument.
    Resources(const std::filesystem::path& folder);  // NOLINT(google-explicit-constructor): a folder says it all
    /// `folder` is only where relative urls start; the policy says what may be opened.
    Resources(const std::filesystem::path& folder, ResourcePolicy policy);
    /// For a document that the user named: opens files below its folder and below the working folder. "-" (standard
    /// input) has the working folder only. An address gives access to no files.
    static Resources ofFile(const std::filesystem::path& file, ResourcePolicy policy = {});

    const std::filesystem::path& folder() const { return folder_; }
    const ResourcePolicy& policy() const { return policy_; }

    /// Opens a url. `from` is the folder of the document that holds it. Errors: a sentence that says why, and which
    /// --allow option helps.
    Result<Resource> open(const std::filesystem::path& from, std::string_view url) const;
    /// Opens a url that stands in `field` of a node.
    Result<Resource> open(const Scene& scene, const Node& node, FieldIndex field, std::string_view url) const;
    /// Starts a fetch that open() would wait for. Returns true as long as open() would wait; false for files, and for
    /// content that is there or cannot be fetched.
    bool awaits(const std::filesystem::path& from, std::string_view url) const;
    bool awaits(const Scene& scene, const Node& node, FieldIndex field, std::string_view url) const;
    /// The same rules, but addresses are refused.
    Resources withoutNetwork() const;

    /// The folders from which relative urls of a node's `field` start: one, or several to try in turn for a url that
    /// came by IS.
    std::vector<std::filesystem::path> foldersOf(const Scene& scene, const Node& node, FieldIndex field) const;
    /// The folder of the document whose nodes have this scope.
    std::filesystem::path folderOf(const Scene& scene, NodeId scope) const;
    /// The folder of the document behind a url that has been opened. For an address, pass the address that answered.
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

/// The url `inner`, which stands in the document behind `outer`, relative to the place of `outer`; without its
/// fragment.
std::string joinUrls(std::string_view outer, std::string_view inner);
/// The text after `#`, decoded.
std::string urlFragment(std::string_view url);
/// Shortens a url for a message.
std::string urlForMessage(std::string_view url);

}  // namespace rtsg
