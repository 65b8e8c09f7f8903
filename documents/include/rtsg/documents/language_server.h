// LanguageServer: what an editor asks about documents that are being written, by the Language Server Protocol.
//
// It reports faults with their places while somebody types, mends misspelled names, completes types, fields and names,
// says what a node or a field is and where the standard has it, and finds what a name means. Documents of ClassicVRML
// and XML have all of it, those of JSON the faults. Whatever an editor sends: a message that is no JSON, of a kind that
// is not known or of wrong members is answered with an error or passed over; sizes and numbers are limited.
// Threading: one thread. Source: Language Server Protocol 3.17; JSON-RPC 2.0.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

#include <rtsg/core/resource.h>

namespace rtsg {

class ScriptLanguage;

struct LanguageServerOptions {
    ResourcePolicy policy{};                  // of what documents name by url, beside what is in their own folders
    const ScriptLanguage* scripts = nullptr;  // by which the texts of Scripts are checked; null: not at all
    std::uint64_t maximumBytes = std::uint64_t{32} << 20;  // of a message, and so of a document
    std::size_t maximumDocuments = 256;                    // that are open at once
};

class LanguageServer {
  public:
    /// `send` takes a message to the editor, without the protocol's header.
    LanguageServer(LanguageServerOptions options, std::function<void(std::string_view message)> send);
    ~LanguageServer();

    /// Takes a message of the editor, without the protocol's header.
    void receive(std::string_view message);
    /// Documents were edited since their faults were reported.
    bool hasWork() const;
    /// Reports the faults of one of these. Call it when no message waits, since the next may edit the document again.
    void work();
    /// The editor has said exit. `wasAsked`: it has asked for the shutdown before.
    bool hasEnded() const;
    bool wasAsked() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Serves an editor over two descriptors until it ends the session. Errors: what comes is not framed as the protocol
/// says, or too long; the editor is gone without an exit.
Result<> serveEditor(int in, int out, const LanguageServerOptions& options);

}  // namespace rtsg
