// LanguageServer: helps editors with documents while they are written, by the Language Server Protocol.
//
// It reports errors with their positions while somebody types, corrects misspelled names, completes types, fields and
// names, explains nodes and fields with their clause of the standard, finds the definition and all places of a name,
// changes names, lists nodes, and indents. For JSON it only reports errors and indents; for ClassicVRML and XML it does
// all. An invalid message (no JSON, an unknown kind, wrong
// members) is answered with an error or ignored; sizes and numbers are limited. Threading: one thread. Source: Language
// Server Protocol 3.17; JSON-RPC 2.0.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

#include <rtsg/core/resource.h>

namespace rtsg {

class ScriptLanguage;

struct LanguageServerOptions {
    ResourcePolicy policy{};                  // for urls in documents; files in a document's own folder are always
                                              // allowed
    const ScriptLanguage* scripts = nullptr;  // checks the programs of Scripts; null: no check
    std::uint64_t maximumBytes = std::uint64_t{32} << 20;  // of a message, and so of a document
    std::size_t maximumDocuments = 256;                    // that are open at once
    std::function<bool()> isAwaited{};  // whether a message waits: work() then ends early; null: it never does
};

class LanguageServer {
  public:
    /// `send` takes a message to the editor, without the protocol's header.
    LanguageServer(LanguageServerOptions options, std::function<void(std::string_view message)> send);
    ~LanguageServer();

    /// Takes a message of the editor, without the protocol's header.
    void receive(std::string_view message);
    /// Whether documents were edited since their errors were reported.
    bool hasWork() const;
    /// Reports the errors of one such document. Call it when no message waits, since the next one may be another edit:
    /// if one comes meanwhile (LanguageServerOptions::isAwaited), it ends, and that document still has work.
    void work();
    /// Whether the editor has said exit. `wasAsked`: it has asked for the shutdown before.
    bool hasEnded() const;
    bool wasAsked() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

/// Serves an editor over two descriptors until it ends the session. Errors: a message is not framed as the protocol
/// says, or too long; the editor ended without an exit.
Result<> serveEditor(int in, int out, const LanguageServerOptions& options);

}  // namespace rtsg
