// ScriptLanguage: a language for Script nodes. ScriptPrograms: the programs of one scene's Script nodes, as the cascade
// sees them.
//
// The scene knows no language until Scene::setScripts() names one, which runScripts() calls; without one its Scripts do
// not run, and a warning for each says so. Threading: the scene's thread; any thread for checkSyntax().
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/document_services.h>
#include <rtsg/core/script.h>

namespace rtsg {

/// The phase of a frame in which a script's onTime is called. initialize() of all new scripts, then prepareEvents(),
/// come before the frame's events.
enum class ScriptPhase { initialize, prepare, run };

class ScriptPrograms {
  public:
    virtual ~ScriptPrograms() = default;

    /// Calls the function that handles events of `field`.
    virtual void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) = 0;
    /// Calls initialize(), prepareEvents() or eventsProcessed(), whichever is due. Returns the same as
    /// Behaviour::onTime; in phase `initialize` it returns now if a program began, else never.
    virtual double onTime(Cascade& cascade, const Node& node, ScriptPhase phase) = 0;
    /// After a garbage collection, calls `visit` for each of `nodes` (sorted) that variables of a program hold. No
    /// program runs.
    virtual void findHeld(const std::vector<NodeId>& nodes,
                          const std::function<void(NodeId script, NodeId held)>& visit) = 0;
    /// Drops the program of a node that is about to be destroyed, after a call of shutdown(), whose outputs are lost.
    virtual void forget(NodeId node) = 0;
    /// The same for all programs, before the scene ends or starts over.
    virtual void forgetAll() = 0;

    /// The functions below serve calls of scripts. Nodes that they make are destroyed once nothing refers to them
    /// (dropped.cpp).
    static Result<NodeId> createNode(Scene& scene, std::string_view type, NodeId scope);
    static Result<DocumentServices::Piece> createPiece(Scene& scene, std::string_view text, NodeId script);
    static Result<DocumentServices::Piece> createPieceOfUrls(Scene& scene, const std::vector<std::string>& urls,
                                                             NodeId script);
    /// The request is served before the next frame begins.
    static Result<> request(Scene& scene, const DocumentRequest& request);
    /// Adds a warning about a program while no cascade runs.
    static void warn(Scene& scene, const Node& node, const std::string& text);
    /// The behaviour of every Script type: it finds the programs of the running scene, and makes them on first use.
    static Behaviour behaviour();

  private:
    /// Returns null if there is no language, which a warning about the node says, or if scripts are not enabled.
    static ScriptPrograms* of(Cascade& cascade, const Node& node);
    static ScriptPhase phase(Cascade& cascade);
};

struct SyntaxFault {
    std::uint32_t line = 0;  // from 1; 0 if unknown
    std::string text{};
};

class ScriptLanguage {
  public:
    virtual ~ScriptLanguage() = default;
    virtual std::unique_ptr<ScriptPrograms> makePrograms(Scene& scene, const ScriptOptions& options) const = 0;
    /// Parses the text without running it. Returns nothing if it is correct.
    virtual std::optional<SyntaxFault> checkSyntax(const std::string& source) const = 0;
};

}  // namespace rtsg
