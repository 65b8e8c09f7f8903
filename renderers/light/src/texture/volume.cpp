// Reads volumes and their render styles from a scene's nodes.
#include "volume.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <fmt/format.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg::trace {

namespace {

constexpr int kMaxNested = 16;
constexpr std::string_view kVoxels = "voxels";
constexpr std::size_t kMaxSteps = 64, kMaxSurfaces = 256;

class VolumeReader {
  public:
    VolumeReader(const Scene& scene, const Node& node, TextureStore& textures, const Volume* before,
                 Diagnostics& diagnostics)
        : scene_(scene), node_(node), textures_(textures), diagnostics_(diagnostics) {
        if (!before) return;
        for (const auto& grid : {before->voxels, before->segments, before->gradients}) keep(grid);
        for (const VolumeStyle& style : before->styles) keepOf(style);
    }

    std::shared_ptr<const Volume> read() {
        if (node_.is(x3d::VolumeData::type)) {
            using V = x3d::VolumeData;
            volume_->dimensions = node_.get(V::dimensions);
            volume_->voxels = grid(node_.get(V::voxels), kVoxels);
            volume_->styles.push_back(style(node_.get(V::renderStyle), true));
        } else if (node_.is(x3d::SegmentedVolumeData::type)) {
            readSegmented();
        } else {
            readSurfaces();
        }
        if (volume_->styles.empty()) volume_->styles.emplace_back();
        return volume_;
    }

  private:
    void keep(const std::shared_ptr<const VoxelGrid>& grid) {
        if (grid) known_.push_back(grid);
    }
    void keepOf(const VolumeStyle& style) {
        for (const StyleStep& step : style.steps) {
            keep(step.normals);
            if (const auto* blended = std::get_if<std::shared_ptr<const Blended>>(&step.what)) {
                keep((*blended)->voxels);
                keepOf((*blended)->style);
            }
        }
    }
    void report(const std::string& what) {
        const std::string name(scene_.name(node_.id()));
        diagnostics_.warningAt(scene_.locationOf(node_.id()),
                               fmt::format("{}{}{} {}", node_.type().name, name.empty() ? "" : " ", name, what));
    }
    /// A number within a range; where it is none, `otherwise`.
    float number(float value, float minimum, float maximum, float otherwise, const char* field) {
        if (std::isfinite(value)) return std::clamp(value, minimum, maximum);
        report(fmt::format("has a style whose {} is no number: taken as {}", field, otherwise));
        return otherwise;
    }
    Vec3f color(const ColorRGBA& from) const { return glm::max(Vec3f(from.r, from.g, from.b), Vec3f(0)); }

    void readSegmented() {
        using V = x3d::SegmentedVolumeData;
        volume_->dimensions = node_.get(V::dimensions);
        volume_->voxels = grid(node_.get(V::voxels), kVoxels);
        volume_->segments = grid(node_.get(V::segmentIdentifiers), "segmentIdentifiers");
        if (volume_->segments && volume_->voxels && volume_->segments->size() != volume_->voxels->size())
            report("has segmentIdentifiers of another size than its voxels: each place has that of the nearest one");
        for (const NodeId id : node_.get(V::renderStyle)) volume_->styles.push_back(style(id, false));
        for (const bool on : node_.get(V::segmentEnabled)) volume_->segmentEnabled.push_back(on);
    }

    void readSurfaces() {
        using V = x3d::IsoSurfaceVolumeData;
        volume_->isSurfaces = true;
        volume_->dimensions = node_.get(V::dimensions);
        volume_->voxels = grid(node_.get(V::voxels), kVoxels);
        volume_->gradients = matching(grid(node_.get(V::gradients), "gradients"), "gradients");
        volume_->tolerance = number(node_.get(V::surfaceTolerance), 0, 1e9f, 0, "surfaceTolerance");
        for (const NodeId id : node_.get(V::renderStyle)) volume_->styles.push_back(style(id, false));
        const Array<float>& values = node_.get(V::surfaceValues);
        const float step = std::abs(number(node_.get(V::contourStepSize), -1e9f, 1e9f, 0, "contourStepSize"));
        std::uint32_t next = 0;
        for (const float value : values) {
            if (std::isfinite(value) && volume_->surfaces.size() < kMaxSurfaces)
                volume_->surfaces.emplace_back(value, next);
            else
                report("has surfaceValues that are no numbers, or over 256: they are left out");
            ++next;
        }
        if (values.size() == 1 && step > 0 && !volume_->surfaces.empty()) addContours(values[0], step);
        std::ranges::sort(volume_->surfaces);
    }
    /// All of the way from 0 to 1; after the one that is given, styles go from the lowest on.
    void addContours(float first, float step) {
        const double from = std::ceil((0 - double{first}) / step), to = std::floor((1 - double{first}) / step);
        std::uint32_t next = 1;
        for (double k = from; k <= to; ++k) {
            if (k == 0) continue;
            if (volume_->surfaces.size() >= kMaxSurfaces) return report("has contours beyond 256: they are left out");
            volume_->surfaces.emplace_back(static_cast<float>(first + k * step), next++);
        }
    }

    std::shared_ptr<const VoxelGrid> grid(NodeId id, std::string_view field) {
        const Node* node = scene_.effectiveNode(id);
        if (!node && field == kVoxels) report("has no voxels: it is not drawn");
        if (!node) return nullptr;
        if (!TextureStore::isSpace(*node)) {
            report(fmt::format("has {} that are no three-dimensional texture", field));
            return nullptr;
        }
        const auto texture = textures_.spaceOfNode(scene_, *node, Texture::Content::data, diagnostics_);
        if (!texture) return nullptr;
        for (const auto& known : known_)
            if (known->isOf(*texture)) return known;
        std::string problem;
        auto created = VoxelGrid::of(texture, problem);
        if (created)
            known_.push_back(created);
        else
            report(fmt::format("has {} that cannot be used: {}", field, problem));
        return created;
    }
    /// 41.3.1: normals of another size than the voxels are warned of and not used.
    std::shared_ptr<const VoxelGrid> matching(std::shared_ptr<const VoxelGrid> normals, const char* field) {
        if (!normals) return nullptr;
        const bool fits = volume_->voxels && normals->size() == volume_->voxels->size();
        if (fits && normals->components() >= 3) return normals;
        report(fmt::format("has {} of another size than its voxels, or of less than 3 components: they are not used",
                           field));
        return nullptr;
    }

    VolumeStyle style(NodeId id, bool whole) {
        VolumeStyle result;
        const Node* node = scene_.effectiveNode(id);
        if (!node) return result;
        result.drawn = isEnabled(*node);
        using P = x3d::ProjectionVolumeStyle;
        if (node->is(P::type)) {
            if (!whole) {
                report("has a ProjectionVolumeStyle for a part of it, which is drawn without a style");
                return result;
            }
            using Projection = VolumeStyle::Projection;
            const std::string_view type = node->get(P::type_).view();
            result.projection = type == "MIN"       ? Projection::smallest
                                : type == "AVERAGE" ? Projection::mean
                                                    : Projection::largest;
            if (type != "MIN" && type != "MAX" && type != "AVERAGE")
                report(fmt::format("has a ProjectionVolumeStyle of type \"{}\": taken as MAX", type));
            result.threshold = number(node->get(P::intensityThreshold), 0, 1, 0, "intensityThreshold");
            return result;
        }
        if (result.drawn) addSteps(*node, result.steps, 0);
        return result;
    }
    static bool isEnabled(const Node& node) {
        const FieldIndex field = node.type().find("enabled");
        return field == kNoField || node.get(Field<bool>{field});
    }

    void addSteps(const Node& node, std::vector<StyleStep>& steps, int depth) {
        if (steps.size() >= kMaxSteps || depth >= kMaxNested)
            return report("has over 64 render styles, or nests them over 16 deep: the rest is left out");
        using C = x3d::ComposedVolumeStyle;
        if (node.is(C::type)) {
            for (const NodeId id : node.get(C::renderStyle))
                if (const Node* part = scene_.effectiveNode(id); part && isEnabled(*part)) {
                    if (part->is(x3d::ProjectionVolumeStyle::type))
                        report("has a ProjectionVolumeStyle in a ComposedVolumeStyle, which is left out");
                    else
                        addSteps(*part, steps, depth + 1);
                }
            return;
        }
        if (auto step = oneStep(node, depth)) steps.push_back(std::move(*step));
    }

    std::optional<StyleStep> oneStep(const Node& node, int depth) {
        if (node.is(x3d::OpacityMapVolumeStyle::type))
            return StyleStep{OpacityMap{transfer(node.get(x3d::OpacityMapVolumeStyle::transferFunction))}, nullptr};
        if (node.is(x3d::BoundaryEnhancementVolumeStyle::type)) {
            using B = x3d::BoundaryEnhancementVolumeStyle;
            return StyleStep{BoundaryEnhancement{number(node.get(B::retainedOpacity), 0, 1, .2f, "retainedOpacity"),
                                                 number(node.get(B::boundaryOpacity), 0, 1, .9f, "boundaryOpacity"),
                                                 number(node.get(B::opacityFactor), 0, 1e4f, 2, "opacityFactor")},
                             nullptr};
        }
        if (node.is(x3d::CartoonVolumeStyle::type)) {
            using C = x3d::CartoonVolumeStyle;
            const ColorRGBA a = node.get(C::orthogonalColor), b = node.get(C::parallelColor);
            return StyleStep{Cartoon{std::clamp(node.get(C::colorSteps), 1, 64),
                                     {color(a), std::clamp(a.a, 0.f, 1.f)},
                                     {color(b), std::clamp(b.a, 0.f, 1.f)}},
                             normals(node.get(C::surfaceNormals))};
        }
        if (node.is(x3d::EdgeEnhancementVolumeStyle::type)) {
            using E = x3d::EdgeEnhancementVolumeStyle;
            const float angle =
                number(node.get(E::gradientThreshold), 0, std::numbers::pi_v<float>, .4f, "gradientThreshold");
            return StyleStep{EdgeEnhancement{color(node.get(E::edgeColor)), std::cos(angle)},
                             normals(node.get(E::surfaceNormals))};
        }
        if (node.is(x3d::SilhouetteEnhancementVolumeStyle::type)) {
            using S = x3d::SilhouetteEnhancementVolumeStyle;
            return StyleStep{SilhouetteEnhancement{
                                 number(node.get(S::silhouetteRetainedOpacity), 0, 1, 1, "silhouetteRetainedOpacity"),
                                 number(node.get(S::silhouetteBoundaryOpacity), 0, 1, 0, "silhouetteBoundaryOpacity"),
                                 number(node.get(S::silhouetteSharpness), 0, 1e4f, .5f, "silhouetteSharpness")},
                             normals(node.get(S::surfaceNormals))};
        }
        if (node.is(x3d::ToneMappedVolumeStyle::type)) {
            using T = x3d::ToneMappedVolumeStyle;
            return StyleStep{ToneMapped{color(node.get(T::coolColor)), color(node.get(T::warmColor))},
                             normals(node.get(T::surfaceNormals))};
        }
        if (node.is(x3d::ShadedVolumeStyle::type)) return shaded(node);
        if (node.is(x3d::BlendedVolumeStyle::type)) return blended(node, depth);
        report(fmt::format("has a {}, which is no style that is drawn", node.type().name));
        return std::nullopt;
    }

    std::shared_ptr<const VoxelGrid> normals(NodeId id) {
        if (!id) return nullptr;
        return matching(grid(id, "surfaceNormals"), "surfaceNormals");
    }

    TransferFunction transfer(NodeId id) {
        TransferFunction map;
        const Node* node = scene_.effectiveNode(id);
        if (!node) return map;
        if (TextureStore::isSpace(*node)) {
            map.block = textures_.spaceOfNode(scene_, *node, Texture::Content::color, diagnostics_);
            if (map.block && map.block->isCube()) {
                report("has a cube map for a transferFunction, which is not used");
                map.block = nullptr;
            }
            return map;
        }
        map.plane = textures_.ofNode(scene_, *node, Texture::Content::color, diagnostics_);
        if (!map.plane) return map;
        TextureAccess access;
        access.wrapS = access.wrapT = TextureWrap::clamp;
        access.smooth = false;
        const auto w = static_cast<float>(map.plane->width()), h = static_cast<float>(map.plane->height());
        for (int i = 0; i < map.plane->width(); ++i)
            map.row.push_back(
                map.plane->sample((static_cast<float>(i) + .5f) / w, .5f / h, 0, access, ColorSpace::display));
        return map;
    }

    StyleStep shaded(const Node& node) {
        using S = x3d::ShadedVolumeStyle;
        Shaded result;
        result.lighting = node.get(S::lighting), result.shadows = node.get(S::shadows);
        if (const std::string_view phase = node.get(S::phaseFunction).view();
            phase != "Henyey-Greenstein" && phase != "NONE")
            report(fmt::format("has a phaseFunction \"{}\", which is neither Henyey-Greenstein nor NONE", phase));
        if (const Node* material = scene_.effectiveNode(node.get(S::material)))
            result.hasMaterial = readShade(*material, result.material);
        return {std::move(result), normals(node.get(S::surfaceNormals))};
    }
    bool readShade(const Node& node, Material& m) {
        const auto vec = [](const Color& c) { return glm::max(Vec3f(c.r, c.g, c.b), Vec3f(0)); };
        m.model = ShadingModel::phong;
        if (node.is(x3d::Material::type)) {
            using M = x3d::Material;
            m.base = vec(node.get(M::diffuseColor)), m.specular = vec(node.get(M::specularColor));
            m.emissive = vec(node.get(M::emissiveColor));
            m.ambient = number(node.get(M::ambientIntensity), 0, 1, .2f, "ambientIntensity");
            m.exponent = 128 * number(node.get(M::shininess), 0, 1, .2f, "shininess");
            m.opacity = 1 - number(node.get(M::transparency), 0, 1, 0, "transparency");
        } else if (node.is(x3d::PhysicalMaterial::type)) {
            using M = x3d::PhysicalMaterial;
            // Its fields hold light.
            m.base = srgbFromLinear(vec(node.get(M::baseColor)));
            m.emissive = srgbFromLinear(vec(node.get(M::emissiveColor)));
            m.opacity = 1 - number(node.get(M::transparency), 0, 1, 0, "transparency");
        } else if (node.is(x3d::UnlitMaterial::type)) {
            using M = x3d::UnlitMaterial;
            m.emissive = vec(node.get(M::emissiveColor));
            m.opacity = 1 - number(node.get(M::transparency), 0, 1, 0, "transparency");
        } else {
            report(fmt::format("has a {} for a material, which is not used", node.type().name));
            return false;
        }
        m.decodeColors();
        return true;
    }

    std::optional<StyleStep> blended(const Node& node, int depth) {
        using B = x3d::BlendedVolumeStyle;
        auto result = std::make_shared<Blended>();
        result->voxels = grid(node.get(B::voxels), "voxels to blend");
        if (!result->voxels) {
            report("has a BlendedVolumeStyle without voxels, which is left out");
            return std::nullopt;
        }
        if (const Node* style = scene_.effectiveNode(node.get(B::renderStyle))) {
            result->style.drawn = isEnabled(*style);
            addSteps(*style, result->style.steps, depth + 1);
        }
        result->first = weight(node.get(B::weightFunction1).view(), node.get(B::weightConstant1),
                               node.get(B::weightTransferFunction1));
        result->second = weight(node.get(B::weightFunction2).view(), node.get(B::weightConstant2),
                                node.get(B::weightTransferFunction2));
        return StyleStep{std::shared_ptr<const Blended>(std::move(result)), nullptr};
    }
    Blended::Weight weight(std::string_view function, float constant, NodeId table) {
        using Function = Blended::WeightFunction;
        constexpr std::pair<std::string_view, Function> kNames[] = {
            {"CONSTANT", Function::constant},
            {"ALPHA1", Function::alpha1},
            {"ALPHA2", Function::alpha2},
            {"ONE_MINUS_ALPHA1", Function::oneMinusAlpha1},
            {"ONE_MINUS_ALPHA2", Function::oneMinusAlpha2},
            {"TABLE", Function::table},
        };
        Blended::Weight result;
        result.constant = number(constant, 0, 1, .5f, "weightConstant");
        const auto* named = std::ranges::find(kNames, function, &std::pair<std::string_view, Function>::first);
        if (named != std::end(kNames))
            result.weight = named->second;
        else
            report(fmt::format("has a weightFunction \"{}\": taken as CONSTANT", function));
        if (result.weight != Function::table) return result;
        if (const Node* node = scene_.effectiveNode(table))
            result.table = textures_.ofNode(scene_, *node, Texture::Content::data, diagnostics_);
        if (!result.table) {
            report("has a weightFunction TABLE without a weightTransferFunction: taken as CONSTANT");
            result.weight = Function::constant;
        }
        return result;
    }

    const Scene& scene_;
    const Node& node_;
    TextureStore& textures_;
    Diagnostics& diagnostics_;
    std::vector<std::shared_ptr<const VoxelGrid>> known_;  // of this and the last time
    std::shared_ptr<Volume> volume_ = std::make_shared<Volume>();
};

}  // namespace

std::shared_ptr<const Volume> readVolume(const Scene& scene, const Node& node, TextureStore& textures,
                                         const Volume* before, Diagnostics& diagnostics) {
    return VolumeReader(scene, node, textures, before, diagnostics).read();
}

}  // namespace rtsg::trace
