// What readers of robots' files in XML share: the tree, reports, and numbers in text.
//
// Threading: one thread a reader.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <map>

#include "urdf_model.h"
#include "xml_tree.h"

namespace rtsg::detail {

class RobotReader {
  public:
    RobotReader(UrdfModel& model, Diagnostics& diagnostics) : model_(model), diagnostics_(diagnostics) {}

  protected:
    void error(const XmlElement& at, const std::string& what) { diagnostics_.error(at.where, what); }
    void warning(const XmlElement& at, const std::string& what) { diagnostics_.warning(at.where, what); }
    static std::string nameOf(const XmlElement& e) {
        const std::string* name = e.attribute("name");
        return name ? *name : std::string();
    }
    /// Counts the children that have another name than those; reportOthers() names them.
    void countOthers(const XmlElement& parent, std::initializer_list<std::string_view> known) {
        for (const std::uint32_t child : parent.children)
            if (const std::string& name = tree_.elements()[child].name; std::ranges::find(known, name) == known.end())
                ++others_[name];
    }
    void reportOthers() {
        std::string all;
        for (const auto& [name, count] : others_)
            all += (all.empty() ? "" : ", ") + name + (count > 1 ? " (" + std::to_string(count) + ")" : "");
        if (!all.empty()) diagnostics_.warning({}, "left out, as nothing is made of it here: " + all);
    }
    /// Takes the white space at the text's beginning off it.
    static void skipBlanks(std::string_view& text) {
        text.remove_prefix(std::min(text.find_first_not_of(kBlank), text.size()));
    }
    /// Takes a number, with a plus sign or without, off the text; false if there is none that a float can be.
    static bool takeNumber(std::string_view& text, double& number) {
        skipBlanks(text);
        std::string_view word = text.substr(0, text.find_first_of(kBlank));
        text.remove_prefix(word.size());
        if (word.starts_with('+')) word.remove_prefix(1);
        const char* const end = word.data() + word.size();
        const auto [at, problem] = std::from_chars(word.data(), end, number);
        return problem == std::errc() && at == end && std::isfinite(static_cast<float>(number));
    }

    UrdfModel& model_;
    Diagnostics& diagnostics_;
    XmlTree tree_;
    std::map<std::string, std::size_t> others_;

  private:
    static constexpr std::string_view kBlank = " \t\r\n";
};

}  // namespace rtsg::detail
