// The module: OGRE's root, a scene manager for each rasteriser, and pictures of it.
#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include <OgreCamera.h>
#include <OgreException.h>
#include <OgreGpuProgramParams.h>
#include <OgreHardwarePixelBuffer.h>
#include <OgreLogManager.h>
#include <OgreMaterialManager.h>
#include <OgreRenderSystem.h>
#include <OgreRenderTexture.h>
#include <OgreRenderWindow.h>
#include <OgreRoot.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreTextureManager.h>
#include <OgreViewport.h>

#include "gpu_object.h"
#include "graphics_thread.h"

namespace rtsg {

namespace {

/// There is one in a process, and it stays: OGRE's parts are singletons, and contexts of graphics are dear.
Ogre::Root* rootOf(std::string& problem) {
    static Ogre::Root* root = nullptr;
    static std::string failure;
    if (root || !failure.empty()) {
        problem = failure;
        return root;
    }
    try {
        auto* log = new Ogre::LogManager;
        log->createLog("rtsg", true, false, true);
        auto* created = new Ogre::Root("", "", "");
        created->loadPlugin(RTSG_OGRE_PLUGINS "/RenderSystem_GL3Plus");
        if (created->getAvailableRenderers().empty()) throw std::runtime_error("OGRE has no OpenGL 3 here");
        created->setRenderSystem(created->getAvailableRenderers()[0]);
        created->initialise(false);
        Ogre::NameValuePairList parameters;
        parameters["hidden"] = "true";
        created->createRenderWindow("rtsg", 1, 1, false, &parameters)->setAutoUpdated(false);
        root = created;
    } catch (const Ogre::Exception& e) {
        failure = e.getDescription();
    } catch (const std::exception& e) {
        failure = e.what();
    }
    problem = failure;
    return root;
}

Ogre::Matrix4 matrix(const glm::mat4& m) {
    return {m[0].x, m[1].x, m[2].x, m[3].x, m[0].y, m[1].y, m[2].y, m[3].y,
            m[0].z, m[1].z, m[2].z, m[3].z, m[0].w, m[1].w, m[2].w, m[3].w};
}
using rtsg::vector;
Ogre::Vector3 vector(const glm::vec3& v) {
    return {v.x, v.y, v.z};
}

class OgreRaster final : public RasterModule {
  public:
    explicit OgreRaster(Ogre::Root& root) : root_(root), prefix_("rtsg" + std::to_string(++count()) + " ") {
        library_ = std::make_unique<GpuLibrary>(prefix_);
        scene_ = root_.createSceneManager();
        eyeNode_ = scene_->getRootSceneNode()->createChildSceneNode();
        camera_ = scene_->createCamera("eye");
        eyeNode_->attachObject(camera_);
        library_->setTable({});
        const RasterVertex corners[3] = {{{-1, -1, 0}}, {{3, -1, 0}}, {{-1, 3, 0}}};
        const RasterLook looks[3];
        const std::uint32_t indices[3] = {0, 1, 2};
        RasterMesh all;
        all.vertices = corners, all.looks = looks, all.indices = indices;
        whole_.emplace().set(all);
        driver_ = root_.getRenderSystem()->getCapabilities()->getDeviceName();
    }
    ~OgreRaster() override {
        onGraphicsThread([this] {
            objects_.clear();
            backgrounds_.clear();
            for (auto& [number, material] : materials_) forget(material.material);
            meshes_.clear(), materials_.clear();
            whole_.reset();
            colors_.drop(), numbers_.drop();
            library_.reset();
            root_.destroySceneManager(scene_);
        });
    }

    std::string driver() const override { return driver_; }
    void run(const std::function<void()>& work) override { onGraphicsThread(work); }
    std::string problem() override { return std::exchange(problem_, {}); }

    void setMesh(std::uint32_t number, const RasterMesh& mesh) override {
        guarded([&] {
            Mesh& held = meshes_[number];
            if (!held.mesh) held.mesh = std::make_unique<GpuMesh>();
            held.mesh->set(mesh);
            for (GpuObject* user : held.users) user->show(*held.mesh);
        });
    }
    void bendMesh(std::uint32_t number, const RasterMesh& mesh) override {
        guarded([&] {
            Mesh& held = meshes_.at(number);
            held.mesh->bend(mesh);
            for (GpuObject* user : held.users) user->show(*held.mesh);
        });
    }
    void dropMesh(std::uint32_t number) override { meshes_.erase(number); }
    void setTexture(std::uint32_t number, const RasterTexture& texture) override {
        guarded([&] { library_->setTexture(number, texture); });
    }
    void dropTexture(std::uint32_t number) override {
        guarded([&] { library_->dropTexture(number); });
    }
    void setMaterial(std::uint32_t number, const RasterMaterial& material) override {
        guarded([&] {
            Ogre::MaterialPtr created = library_->makeMaterial("material", material);
            Material& held = materials_[number];
            for (GpuObject* user : held.users) user->setMaterial(created);
            forget(held.material);
            held.material = created, held.from = material, held.numbered = false;
        });
    }
    void dropMaterial(std::uint32_t number) override {
        guarded([&] {
            forget(materials_[number].material);
            materials_.erase(number);
        });
    }

    void setItem(std::uint32_t number, const RasterObject& object) override {
        guarded([&] {
            Placed& placed = objects_[number];
            if (!placed.object) {
                placed.object = std::make_unique<GpuObject>(view_);
                placed.scene = scene_;
                placed.node = scene_->getRootSceneNode()->createChildSceneNode();
                placed.node->attachObject(placed.object.get());
            }
            unlink(*placed.object);
            placed.object->setItem(number, object, recordOf(object.surroundings));
            Mesh& mesh = meshes_.at(object.mesh);
            Material& material = materials_.at(object.material);
            placed.object->show(*mesh.mesh);
            placed.object->setMaterial(material.material);
            mesh.users.insert(placed.object.get()), material.users.insert(placed.object.get());
            placed.node->setPosition(vector(object.position));
        });
    }
    void moveItem(std::uint32_t number, const glm::mat3& linear, const glm::vec3& position, bool mirrored) override {
        const auto found = objects_.find(number);
        if (found == objects_.end()) return;
        found->second.object->setLinear(linear, mirrored);
        found->second.node->setPosition(vector(position));
    }
    void dropItem(std::uint32_t number) override {
        const auto found = objects_.find(number);
        if (found == objects_.end()) return;
        unlink(*found->second.object);
        objects_.erase(found);
    }
    void setTables(const RasterTables& tables) override {
        guarded([&] { layOut(tables); });
    }
    void draw(int width, int height, const std::vector<RasterView>& views, std::vector<glm::vec4>& pixels) override {
        pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), glm::vec4(0));
        guarded([&] {
            colors_.aim(width, height, *camera_, prefix_ + "picture ", Ogre::PF_FLOAT16_RGBA);
            for (std::size_t i = 0; i < views.size(); ++i) {
                showBackground(views[i], i);
                drawView(colors_, views[i], i);
            }
            colors_.read(pixels);
        });
    }
    void drawNumbers(int width, int height, const RasterView& view, std::vector<glm::vec4>& pixels) override {
        pixels.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), glm::vec4(0));
        guarded([&] {
            for (auto& [number, material] : materials_)
                if (!std::exchange(material.numbered, true)) library_->addNumbers(material.material, material.from);
            numbers_.aim(width, height, *camera_, prefix_ + "numbers ", Ogre::PF_FLOAT32_RGBA);
            numbers_.viewport->setMaterialScheme(GpuLibrary::kNumbers);
            hideBackgrounds();
            drawView(numbers_, view, 0);
            numbers_.read(pixels);
        });
    }

  private:
    struct Placed {
        std::unique_ptr<GpuObject> object;
        Ogre::SceneNode* node = nullptr;
        Ogre::SceneManager* scene = nullptr;
        Placed() = default;
        Placed(const Placed&) = delete;
        Placed& operator=(const Placed&) = delete;
        ~Placed() {
            if (!node) return;
            node->detachAllObjects();
            scene->destroySceneNode(node);
        }
    };
    struct Mesh {
        std::unique_ptr<GpuMesh> mesh;
        std::set<GpuObject*> users;
    };
    struct Material {
        Ogre::MaterialPtr material;
        RasterMaterial from;
        bool numbered = false;  // it shows numbers, too
        std::set<GpuObject*> users;
    };
    struct Background {
        RasterSky sky;
        Ogre::MaterialPtr material;
        Placed item;
        Background() = default;
        Background(const Background&) = delete;
        Background& operator=(const Background&) = delete;
        ~Background() { forget(material); }
    };

    /// A texture to draw into.
    struct Target {
        Ogre::TexturePtr texture;
        Ogre::Viewport* viewport = nullptr;
        int created = 0;
        void drop() {
            if (texture) Ogre::TextureManager::getSingleton().remove(texture);
            texture.reset();
        }
        void aim(int width, int height, Ogre::Camera& camera, const std::string& name, Ogre::PixelFormat format) {
            const auto w = static_cast<Ogre::uint>(width), h = static_cast<Ogre::uint>(height);
            if (texture && texture->getWidth() == w && texture->getHeight() == h) return;
            drop();
            texture = Ogre::TextureManager::getSingleton().createManual(
                name + std::to_string(++created), Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME,
                Ogre::TEX_TYPE_2D, w, h, 0, format, Ogre::TU_RENDERTARGET);
            surface().setAutoUpdated(false);
            viewport = surface().addViewport(&camera);
            viewport->setOverlaysEnabled(false);
            viewport->setShadowsEnabled(false);
            viewport->setBackgroundColour(Ogre::ColourValue(0, 0, 0, 0));
        }
        Ogre::RenderTexture& surface() const { return *texture->getBuffer()->getRenderTarget(); }
        void read(std::vector<glm::vec4>& pixels) const {
            texture->getBuffer()->blitToMemory(
                Ogre::PixelBox(texture->getWidth(), texture->getHeight(), 1, Ogre::PF_FLOAT32_RGBA, pixels.data()));
        }
    };

    static int& count() {
        static int created = 0;
        return created;
    }
    static void forget(const Ogre::MaterialPtr& material) {
        if (material) Ogre::MaterialManager::getSingleton().remove(material);
    }
    template <class Do>
    void guarded(const Do& act) {
        try {
            act();
        } catch (const Ogre::Exception& e) {
            keepFirst(e.getDescription());
        } catch (const std::exception& e) {
            keepFirst(e.what());
        }
    }

    /// Keeps only the first error, because the others follow from it.
    void keepFirst(const std::string& what) {
        if (problem_.empty()) problem_ = what;
    }
    void unlink(GpuObject& object) {
        if (const auto mesh = meshes_.find(object.item().mesh); mesh != meshes_.end())
            mesh->second.users.erase(&object);
        if (const auto material = materials_.find(object.item().material); material != materials_.end())
            material->second.users.erase(&object);
    }
    int recordOf(std::uint32_t surroundings) const {
        return surroundings < records_.size() ? records_[surroundings] : 0;
    }

    void layOut(const RasterTables& tables) {
        std::vector<glm::vec4> texels;
        std::vector<std::size_t> lights;  // where each begins
        for (const RasterLight& l : tables.lights) {
            lights.push_back(texels.size());
            texels.insert(texels.end(), {glm::vec4(l.kind, l.radius, l.localFromWorld, l.beamWidth),
                                         glm::vec4(l.color, l.cutOffAngle), glm::vec4(l.ambient, 0)});
            if (l.kind == 3)
                for (const glm::vec3& one : l.harmonics) texels.emplace_back(one, 0);
            else
                texels.insert(texels.end(),
                              {glm::vec4(l.position, 0), glm::vec4(l.direction, 0), glm::vec4(l.attenuation, 0)});
        }
        records_.clear();
        for (const RasterSurroundings& surroundings : tables.surroundings) {
            const auto first = texels.size();
            for (const std::uint32_t light : surroundings.lights)
                texels.emplace_back(static_cast<float>(lights.at(light)), 0, 0, 0);
            const auto cuts = texels.size();
            texels.insert(texels.end(), surroundings.cuts.begin(), surroundings.cuts.end());
            records_.push_back(static_cast<int>(texels.size()));
            texels.insert(texels.end(),
                          {glm::vec4(static_cast<float>(first), static_cast<float>(surroundings.lights.size()),
                                     static_cast<float>(cuts), static_cast<float>(surroundings.cuts.size())),
                           glm::vec4(surroundings.fogType, surroundings.fogRange, surroundings.fogBegin, 0),
                           glm::vec4(surroundings.fogColor, 0), glm::vec4(surroundings.fogAlong, 0)});
        }
        if (!library_->setTable(std::move(texels))) keepFirst("there are too many lights at too many places");
        for (auto& [id, item] : objects_) item.object->setRecord(recordOf(item.object->item().surroundings));
    }

    void setNumbers(const RasterView& v) {
        const auto set = [&](DrawNumber which, const Ogre::Vector4& value) {
            view_[static_cast<std::size_t>(which)] = value;
        };
        set(DrawNumber::eyePosition, vector(v.eye, v.orthographic ? 1.0f : 0.0f));
        set(DrawNumber::eyeForward, vector(v.forward, v.upPixels.z));
        set(DrawNumber::eyeRight, vector(v.right, v.headlight ? 1.0f : 0.0f));
        set(DrawNumber::eyeUp, vector(v.up, v.upPixels.y));
        set(DrawNumber::eyeLimits, {v.nearDistance, v.farDistance, v.visibilityLimit, v.upPixels.x});
        set(DrawNumber::eyePixels, {v.pixelSpread, v.pixelSize, 0, 0});
        set(DrawNumber::eyeMore, {v.sampleFraction, v.acrossPixels.x, v.acrossPixels.y, v.acrossPixels.z});
        set(DrawNumber::eyeEdges, {v.left, v.rightEdge, v.bottom, v.top});
        set(DrawNumber::squareX, vector(v.square[0], v.uneven ? 1.0f : 0.0f));
        set(DrawNumber::squareY, vector(v.square[1], 0)), set(DrawNumber::squareZ, vector(v.square[2], 0));
        set(DrawNumber::pictureSize, {static_cast<float>(v.width), static_cast<float>(v.height), 0, 0});
    }

    void hideBackgrounds() {
        for (auto& [id, other] : backgrounds_) other.item.object->setVisible(false);
    }
    void showBackground(const RasterView& view, std::size_t number) {
        hideBackgrounds();
        if (view.sky.colors.empty()) return;
        Background& background = backgrounds_[number];
        if (!background.item.object) {
            background.item.object = std::make_unique<GpuObject>(view_);
            background.item.scene = scene_;
            background.item.node = scene_->getRootSceneNode()->createChildSceneNode();
            background.item.node->attachObject(background.item.object.get());
            background.item.object->setRenderOperation(whole_->operation());
            background.item.object->setBackground();
        }
        if (!background.material || background.sky != view.sky) {
            const Ogre::MaterialPtr before = background.material;
            background.material = library_->makeBackground("background", view.sky);
            background.item.object->setMaterial(background.material);
            background.sky = view.sky;
            forget(before);
        }
        background.item.object->setVisible(true);
    }

    /// `number`: of the view; the first one begins the picture.
    void drawView(Target& target, const RasterView& view, std::size_t number) {
        Ogre::RenderTexture& surface = target.surface();
        const auto w = static_cast<float>(surface.getWidth()), h = static_cast<float>(surface.getHeight());
        target.viewport->setDimensions(static_cast<float>(view.x) / w, static_cast<float>(view.y) / h,
                                       static_cast<float>(view.width) / w, static_cast<float>(view.height) / h);
        target.viewport->setClearEveryFrame(true, number == 0 ? Ogre::FBT_COLOUR | Ogre::FBT_DEPTH : Ogre::FBT_DEPTH);
        target.viewport->setVisibilityMask(1u << std::min<unsigned>(view.layer, 31));
        eyeNode_->setPosition(vector(view.eye));
        camera_->setCustomViewMatrix(true, Ogre::Affine3(matrix(view.viewFromWorld)));
        camera_->setCustomProjectionMatrix(true, matrix(view.projection));
        setNumbers(view);
        surface.update();
    }

    Ogre::Root& root_;
    const std::string prefix_;
    std::string driver_;
    std::unique_ptr<GpuLibrary> library_;
    Ogre::SceneManager* scene_ = nullptr;
    Ogre::SceneNode* eyeNode_ = nullptr;
    Ogre::Camera* camera_ = nullptr;
    Target colors_, numbers_;
    ViewNumbers view_{};
    std::optional<GpuMesh> whole_;  // a triangle over the whole picture
    std::map<std::uint32_t, Mesh> meshes_;
    std::map<std::uint32_t, Material> materials_;
    std::map<std::uint32_t, Placed> objects_;
    std::map<std::size_t, Background> backgrounds_;  // by the number of the view
    std::vector<int> records_;                       // by place
    std::string problem_;
};

std::unique_ptr<RasterModule> openRaster(std::string& problem) {
    std::unique_ptr<RasterModule> opened;
    onGraphicsThread([&] {
        Ogre::Root* root = rootOf(problem);
        if (!root) return;
        try {
            opened = std::make_unique<OgreRaster>(*root);
        } catch (const Ogre::Exception& e) {
            problem = e.getDescription();
        } catch (const std::exception& e) {
            problem = e.what();
        }
    });
    return opened;
}

}  // namespace

}  // namespace rtsg

extern "C" __attribute__((visibility("default"))) rtsg::OpenRaster rtsg_open_raster_3() {
    return &rtsg::openRaster;
}
