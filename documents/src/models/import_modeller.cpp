// Converts a file to GLB by libassimp, and imports that.
#include "import_modeller.h"

#include <algorithm>
#include <charconv>
#include <stdexcept>

#include <rtsg/core/machine.h>
#include <rtsg/core/module.h>
#include <rtsg/core/sandbox.h>
#include <rtsg/documents/filter.h>

#include "assimp_module.h"

namespace rtsg::detail {

namespace {

struct ModellerKind {
    FileKind kind;
    std::string_view name;
    const char* extension;  // by which libassimp finds its reader
};
constexpr ModellerKind kKinds[] = {{FileKind::collada, "Collada", "dae"},
                                   {FileKind::fbx, "FBX", "fbx"},
                                   {FileKind::threeDs, "3DS", "3ds"},
                                   {FileKind::off, "OFF", "off"}};

/// The importer of glTF makes PhysicalMaterials, whose colours are light; colours of these files are those of
/// Materials.
class PlainMaterials final : public Filter {
  public:
    PlainMaterials(DocumentHandler& next, std::string_view from) : Filter(next), from_(from) {}

    void meta(std::string_view name, std::string_view content, SourceLocation where) override {
        if (name == "generator") return;
        Filter::meta(name, name == "translated" ? "from " + from_ : std::string(content), where);
    }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        ++depth_;
        if (left_ > 0) return;
        if (isInMaterial(depth_ - 1) && isLeftOut(field)) {
            left_ = depth_;
            return;
        }
        field = fieldOf(field, depth_ - 1);
        if (type == "PhysicalMaterial" && material_ == 0) {
            material_ = depth_;
            type = "Material";
        }
        Filter::beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) override {
        if (depth_ == material_) material_ = 0;
        if (left_ == 0)
            Filter::endNode(where);
        else if (left_ == depth_)
            left_ = 0;
        --depth_;
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        if (left_ > 0 || (isInMaterial(depth_) && isLeftOut(field))) return;
        Filter::useNode(def, fieldOf(field, depth_), where);
    }
    void setField(std::string_view name, Value value, SourceLocation where) override {
        if (left_ > 0 || (isInMaterial(depth_) && isLeftOut(name))) return;
        Filter::setField(fieldOf(name, depth_), std::move(value), where);
    }

  private:
    bool isInMaterial(std::size_t depth) const { return material_ > 0 && material_ == depth; }
    static bool isLeftOut(std::string_view field) { return field.starts_with("metallic") || field == "roughness"; }
    /// baseColor, baseTexture and baseTextureMapping are called diffuse in a Material.
    std::string_view fieldOf(std::string_view field, std::size_t depth) {
        constexpr std::string_view kBase = "base";
        if (!isInMaterial(depth) || !field.starts_with(kBase)) return field;
        return renamed_ = "diffuse" + std::string(field.substr(kBase.size()));
    }

    std::string from_, renamed_;
    std::size_t depth_ = 0;
    std::size_t material_ = 0, left_ = 0;  // depths of the open PhysicalMaterial and of the part that is left out; 0:
                                           // none
};

#ifndef RTSG_NO_ASSIMP
Result<MakeGlb> makerOfGlb() {
    const auto symbol = loadModule("rtsg_assimp", RTSG_ASSIMP_SYMBOL, "files of modellers need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<MakeGlb (*)()>(*symbol)();
}
Result<> prepareModeller() {
    const auto maker = makerOfGlb();
    return maker ? Result<>() : std::unexpected(maker.error());
}
/// The head is the extension. One text comes back: how long the library's faults are, these, and the GLB.
void serveModeller(SandboxJob& job) {
    const std::string extension(job.head());
    const std::string_view bytes(reinterpret_cast<const char*>(job.bytes().data()), job.bytes().size());
    std::string glb, faults;
    if (!(*makerOfGlb())(bytes, extension.c_str(), glb, faults)) throw std::runtime_error(glb);
    const std::string first = std::to_string(faults.size()) + ' ' + faults;
    std::uint8_t* const to = job.room(first.size() + glb.size()).data();
    std::ranges::copy(first, to);
    std::ranges::copy(glb, to + first.size());
    job.answer({});
}
constexpr SandboxTask kModeller{"files of modellers", prepareModeller, serveModeller, true};
#endif

/// The first of its lines, without what kind of a message it is.
std::string_view lineOf(std::string_view messages) {
    const std::string_view line = messages.substr(0, messages.find('\n'));
    const std::size_t colon = line.find(": ");  // "Error, T1: "
    return line.starts_with("Error") && colon != line.npos ? line.substr(colon + 2) : line;
}

}  // namespace

bool importModeller(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics) {
    constexpr std::size_t kHead = 4096;
    const FileKind found = fileKind(input.bytes.substr(0, kHead), input.bytes.size());
    const auto* kind = std::ranges::find(kKinds, found, &ModellerKind::kind);
    if (kind == std::end(kKinds)) return false;
    const std::string name(kind->name);
#ifdef RTSG_NO_ASSIMP
    (void)handler;
    diagnostics.error({}, "this build leaves " + name + " files out (libassimp-dev, RTSG_ASSIMP)",
                      DiagnosticCode("module"));
    return false;
#else
    constexpr std::uint64_t kMax = std::uint64_t{4} << 30, kMaxSeconds = 60;
    const std::uint64_t room = memoryLimit() - std::min(heldMemory(), memoryLimit());
    const auto created = runSandboxed(
        kModeller, kind->extension, {reinterpret_cast<const std::uint8_t*>(input.bytes.data()), input.bytes.size()}, {},
        {std::min({input.maximumBytes, kMax, room}), static_cast<unsigned>(std::min(input.time.left(), kMaxSeconds))});
    std::string text(created ? created->size() : 0, '\0');
    if (created && !created->read({reinterpret_cast<std::uint8_t*>(text.data()), text.size()})) text.clear();
    if (!created) {
        diagnostics.error({}, "the " + name + " file cannot be read: " + created.error().text);
        return false;
    }
    // What a broken library says may be anything.
    const std::size_t blank = std::min(text.find(' '), text.size());
    std::size_t length = 0;
    std::from_chars(text.data(), text.data() + blank, length);
    std::string_view glb = std::string_view(text).substr(std::min(blank + 1, text.size()));
    std::string_view faults = glb.substr(0, length);
    glb.remove_prefix(faults.size());
    while (!faults.empty()) {
        // What has no material gets one that is grey, as here.
        constexpr std::string_view kWarning = "Warning: ";
        if (const std::string_view one = lineOf(faults); one.starts_with(kWarning))
            diagnostics.warning({}, "the " + name + " file: " + std::string(one.substr(kWarning.size())));
        else if (!one.contains("default material"))
            diagnostics.error({}, "the " + name + " file is damaged: " + std::string(one));
        const std::size_t end = faults.find('\n');
        faults.remove_prefix(end == faults.npos ? faults.size() : end + 1);
    }
    PlainMaterials plain(handler, name);
    return importGltf({glb, input.open, input.maximumBytes, input.clip, true}, plain, diagnostics);
#endif
}

}  // namespace rtsg::detail
