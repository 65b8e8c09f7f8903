// An expat parser for files of strangers, with bounds of our own on what a document type may declare.
//
// Invariant: entities nest at most kDeepest deep, whatever their order, since expat follows them by recursion; a
// document declares at most kMaxEntities of them and kMaxAttributes attributes, which expat looks through for each
// element. What entities expand to has at most kMaximumAmplification times the bytes that were read. Entities in other
// files are reported, and never opened. A bound that is exceeded is reported, and ends the reading. Threading: one
// thread. Source: XML 1.0, 4.2 and 4.4.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

// expat declares its limits on entities only where this is said; Debian builds it so.
#define XML_DTD 1
#include <expat.h>

namespace rtsg::detail {

class XmlParser {
  public:
    static constexpr std::uint32_t kDeepest = 32;
    static constexpr std::size_t kMaxEntities = 10'000, kMaxAttributes = 1'000;

    /// `report` gets what is wrong with a declaration, while expat is at it.
    explicit XmlParser(std::function<void(std::string)> report);
    operator XML_Parser() const { return parser_.get(); }  // NOLINT(google-explicit-constructor): expat's functions
    /// `user`, whose member this is, is what all handlers get.
    template <auto Member, class User>
    void giveHandlers(User& user) {
        XML_SetUserData(parser_.get(), &user);
        XML_SetEntityDeclHandler(parser_.get(), [](void* data, const char* name, int isParameter, const char* value,
                                                   int length, const char*, const char*, const char*, const char*) {
            (static_cast<User*>(data)->*Member)
                .declareEntity(name, isParameter != 0, value,
                               value ? std::string_view(value, static_cast<std::size_t>(length)) : std::string_view());
        });
        XML_SetAttlistDeclHandler(parser_.get(), [](void* data, const char*, const char*, const char*, const char*,
                                                    int) { (static_cast<User*>(data)->*Member).declareAttribute(); });
    }
    /// Whether a bound has ended the reading.
    bool isRefused() const { return refused_; }

  private:
    static constexpr float kMaximumAmplification = 20;
    static constexpr unsigned long long kAmplificationFrom = 1 << 20;  // bytes

    struct Entity {
        std::uint32_t depth = 0;  // of entities within it
        std::vector<std::uint32_t> usedBy{};
    };

    void declareEntity(std::string_view name, bool isParameter, bool isHere, std::string_view value);
    void declareAttribute();
    std::uint32_t numberOf(std::string_view entity);
    void deepen(std::uint32_t entity, std::uint32_t depth);
    void refuse(const std::string& why);

    std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser_;
    std::function<void(std::string)> report_;
    std::unordered_map<std::string, std::uint32_t> numbers_;
    std::vector<Entity> entities_;
    std::size_t declared_ = 0, attributes_ = 0;
    bool refused_ = false;
};

}  // namespace rtsg::detail
