// The content of the overlay as plain data: the scene's side makes it, and the window's module draws it.
//
// Invariant: nothing here depends on how it is drawn; equal contents look the same. Nodes are given by their numbers.
// Threading: plain data.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace rtsg {

struct OverlayContent {
    struct Line {
        std::string name, value;
        bool isWrong = false;        // it is told in a warning colour
        std::optional<double> time;  // a place on the time line to go to, seconds
        friend bool operator==(const Line&, const Line&) = default;
    };
    struct Viewpoint {
        std::uint32_t node = 0;
        std::string name;
        bool isBound = false;
        friend bool operator==(const Viewpoint&, const Viewpoint&) = default;
    };
    /// A line of the tree of nodes.
    struct Row {
        std::uint32_t node = 0;  // 0: of no node, a remark
        int depth = 0;
        std::string name, type;  // its DEF name, which may be empty
        bool opens = false, isOpen = false, isPicked = false;
        bool hides = false, isVisible = true;  // it has a field `visible`
        friend bool operator==(const Row&, const Row&) = default;
    };
    struct Field {
        std::string name, value;
        bool isDefault = false;
        std::uint32_t node = 0;  // that it refers to; 0: none, or several
        friend bool operator==(const Field&, const Field&) = default;
    };
    struct Picked {
        std::uint32_t node = 0;
        std::string name, type;
        std::vector<Field> fields;
        std::vector<std::string> routes;
        friend bool operator==(const Picked&, const Picked&) = default;
    };
    struct Mark {
        double time = 0;  // seconds
        std::string text;
        bool isDamage = false;
        friend bool operator==(const Mark&, const Mark&) = default;
    };
    struct Timeline {
        double time = 0, length = 0, rate = 1;  // seconds, seconds, seconds a second
        std::shared_ptr<const std::vector<Mark>> marks;
        friend bool operator==(const Timeline&, const Timeline&) = default;
    };

    /// The bar at the top: what a user may choose, as it is now.
    struct Bar {
        std::string navigation, pictures;
        bool walls = true, ground = true;
        double speed = 1;              // metres a second
        std::optional<double> volume;  // 0 to 1; none: there is no sound
        bool canGoBack = false, writesLog = false, writesFilm = false;
        friend bool operator==(const Bar&, const Bar&) = default;
    };
    struct Message {
        enum class Level : std::uint8_t { note, warning, error } level = Level::note;
        std::string text;
        friend bool operator==(const Message&, const Message&) = default;
    };
    /// A folder, to choose a file in.
    struct Files {
        struct Entry {
            std::string name;
            bool isFolder = false;
            friend bool operator==(const Entry&, const Entry&) = default;
        };
        std::string folder;
        std::vector<Entry> entries;
        friend bool operator==(const Files&, const Files&) = default;
    };

    std::optional<Bar> bar;
    bool hasDetails = false;        // the panels at the sides and the time line
    std::vector<Message> messages;  // the last one is the newest
    std::size_t messageCount = 0;   // with those that are no longer in the list
    bool listsMessages = false;
    std::vector<Line> keys;  // the list of keys; empty: it is hidden
    std::optional<Files> files;
    std::string tip;  // at the pointer
    std::vector<Line> lines;
    std::vector<float> frameTimes;  // milliseconds between pictures in motion, the last ones
    float budget = 0;               // milliseconds
    std::vector<Viewpoint> viewpoints;
    std::vector<Row> tree;
    std::optional<Picked> picked;
    std::vector<Line> history;  // of a field
    std::optional<Timeline> timeline;
    bool isPaused = false, hasHistory = false;  // the application can tell who changed a field
    friend bool operator==(const OverlayContent&, const OverlayContent&) = default;
};

/// A user's action in the overlay.
struct OverlayAction {
    enum class Kind : std::uint8_t {
        viewpoint,   // node: to be looked from
        open,        // node: its row opens or closes
        pick,        // node
        hide,        // node: to be seen or no longer
        history,     // node, name: of which field
        pause,       // time stops or goes on
        seek,        // number: seconds
        step,        // number: states, back if negative
        rate,        // number
        navigation,  // name: of the type
        walls,       // they stop the viewer or no longer do; ground the same
        ground,
        speed,       // number: a factor
        viewAll,     // all is to be seen
        straighten,  // up is to be up
        pictures,    // name: by what they are made
        volume,      // number: 0 to 1
        screenshot,
        log,
        film,
        back,   // to the scene before
        files,  // the list of files appears or goes; folder, file: name
        folder,
        file,
        keys,     // the list of keys appears or goes
        details,  // the panels at the sides appear or go
        hideBar,
        messages,  // the list of messages appears or goes
        copy,      // all messages, to the clipboard
        forget,    // all messages
    };
    Kind kind = Kind::pick;
    std::uint32_t node = 0;
    double number = 0;
    std::string name;
};

}  // namespace rtsg
