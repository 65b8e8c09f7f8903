// ScriptPrograms: the programs of one scene's Script nodes, as the cascade sees them.
//
// The scene does not know in what language they are written: who does, in script/, defines makeScriptPrograms(), and a
// build without scripts has script/absent.cpp there instead. Threading: the scene's thread.
#pragma once

#include <functional>
#include <memory>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/script.h>

#include "document_services.h"

namespace rtsg {

/// What a script's onTime is for: before a frame's events come initialize() of all that are new, then prepareEvents().
enum class ScriptPhase { initialize, prepare, run };

class ScriptPrograms {
  public:
    virtual ~ScriptPrograms() = default;

    /// Calls the function that handles events of `field`.
    virtual void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) = 0;
    /// initialize(), prepareEvents() or eventsProcessed(), as is due. As Behaviour::onTime; in phase `initialize` now
    /// if a program began, else never.
    virtual double onTime(Cascade& cascade, const Node& node, ScriptPhase phase) = 0;
    /// Tells which of `nodes`, sorted, each program's variables hold, after a collection of garbage. No program runs.
    virtual void findHeld(const std::vector<NodeId>& nodes,
                          const std::function<void(NodeId script, NodeId held)>& visit) = 0;
    /// Drops the program of a node that is about to be destroyed; shutdown() is called, its outputs go nowhere.
    virtual void forget(NodeId node) = 0;
    /// The same for all, before the scene goes or starts over.
    virtual void forgetAll() = 0;

    /// For a script: what it makes goes once nothing refers to it (dropped.cpp).
    static Result<NodeId> createNode(Scene& scene, std::string_view type, NodeId scope);
    static Result<detail::Piece> createPiece(Scene& scene, std::string_view text, NodeId script);
    static Result<detail::Piece> createPieceOfUrls(Scene& scene, const std::vector<std::string>& urls, NodeId script);
    /// Is done before the next frame begins.
    static Result<> request(Scene& scene, const DocumentRequest& request);
    /// What is to say of a program while no cascade runs.
    static void warn(Scene& scene, const Node& node, const std::string& text);
    /// The behaviour of every Script type: finds the programs of the running scene, makes them on first use.
    static Behaviour behaviour();

  private:
    static ScriptPrograms* of(Cascade& cascade);
    static ScriptPhase phase(Cascade& cascade);
};

std::unique_ptr<ScriptPrograms> makeScriptPrograms(Scene& scene, const ScriptOptions& options);

}  // namespace rtsg
