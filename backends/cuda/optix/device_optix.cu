#include "backends/cuda/device_optix.h"

#include <optix_stubs.h>

#include <algorithm>

#include "backends/cuda/optix/params.h"
#include "backends/cuda/optix/structure.h"
#include "core/seconds.h"

namespace ambilux {

/// programs.cu in PTX (cmake/embed_text.cmake).
extern const char kOptixPrograms[];
extern const unsigned long kOptixProgramsSize;

namespace {

struct alignas(OPTIX_SBT_RECORD_ALIGNMENT) Record {
    char header[OPTIX_SBT_RECORD_HEADER_SIZE];
};

/// In the order of their records; those of hit groups in that of params.h.
enum Program : uint32_t { kClosest, kOccluded, kMiss, kTriangleHit, kQuadricHit, kPrograms };

OptixProgramGroupDesc describe(OptixModule module, OptixProgramGroupKind kind, const char* name) {
    OptixProgramGroupDesc d = {};
    d.kind = kind;
    (kind == OPTIX_PROGRAM_GROUP_KIND_MISS ? d.miss : d.raygen) = {module, name};
    return d;
}
OptixProgramGroupDesc hits(OptixModule module, const char* closest, const char* any, const char* intersection) {
    OptixProgramGroupDesc d = {};
    d.kind = OPTIX_PROGRAM_GROUP_KIND_HITGROUP;
    d.hitgroup = {module, closest, any ? module : nullptr, any, intersection ? module : nullptr, intersection};
    return d;
}

/// The programs, compiled for the device by the driver, which keeps them in a cache of its own.
class Pipeline {
public:
    Pipeline(const OptixContext& optix, bool two_levels) : optix_(optix) {
        OptixPipelineCompileOptions options = {};
        options.traversableGraphFlags = two_levels ? OPTIX_TRAVERSABLE_GRAPH_FLAG_ALLOW_SINGLE_LEVEL_INSTANCING
                                                   : OPTIX_TRAVERSABLE_GRAPH_FLAG_ALLOW_SINGLE_GAS;
        options.numPayloadValues = 4;
        options.numAttributeValues = 2;
        options.pipelineLaunchParamsVariableName = "optix_params";
        options.usesPrimitiveTypeFlags = OPTIX_PRIMITIVE_TYPE_FLAGS_TRIANGLE | OPTIX_PRIMITIVE_TYPE_FLAGS_CUSTOM;
        OptixModuleCompileOptions module = {};
        // What compilers say comes through the log of the context too.
        optix.check(optixModuleCreate(optix.get(), &module, &options, kOptixPrograms, kOptixProgramsSize, nullptr,
                                      nullptr, &module_),
                    "compiling its programs");
        const OptixProgramGroupDesc described[kPrograms] = {
            describe(module_, OPTIX_PROGRAM_GROUP_KIND_RAYGEN, "__raygen__closest"),
            describe(module_, OPTIX_PROGRAM_GROUP_KIND_RAYGEN, "__raygen__occluded"),
            describe(module_, OPTIX_PROGRAM_GROUP_KIND_MISS, "__miss__none"),
            hits(module_, "__closesthit__triangle", "__anyhit__triangle", nullptr),
            hits(module_, "__closesthit__quadric", nullptr, "__intersection__quadric")};
        const OptixProgramGroupOptions none = {};
        optix.check(optixProgramGroupCreate(optix.get(), described, kPrograms, &none, nullptr, nullptr, programs_),
                    "its programs");
        OptixPipelineLinkOptions link = {};
        link.maxTraceDepth = 1;
        optix.check(
            optixPipelineCreate(optix.get(), &options, &link, programs_, kPrograms, nullptr, nullptr, &pipeline_),
            "its pipeline");
        set_stack(two_levels ? 2 : 1);
        pack_records();
    }
    ~Pipeline() {
        if (pipeline_) optixPipelineDestroy(pipeline_);
        for (const OptixProgramGroup program : programs_)
            if (program) optixProgramGroupDestroy(program);
        if (module_) optixModuleDestroy(module_);
    }
    Pipeline(const Pipeline&) = delete;
    Pipeline& operator=(const Pipeline&) = delete;

    void launch(Program program, const DeviceBuffer<OptixParams>& params, uint32_t width, cudaStream_t stream) const {
        OptixShaderBindingTable table = {};
        table.raygenRecord = record(program);
        table.missRecordBase = record(kMiss);
        table.missRecordStrideInBytes = sizeof(Record);
        table.missRecordCount = 1;
        table.hitgroupRecordBase = record(kTriangleHit);
        table.hitgroupRecordStrideInBytes = sizeof(Record);
        table.hitgroupRecordCount = 2;
        optix_.check(optixLaunch(pipeline_, stream, reinterpret_cast<CUdeviceptr>(params.data()), sizeof(OptixParams),
                                 &table, width, 1, 1),
                     program == kOccluded ? "occlude" : "extend");
    }
    /// With the stacks of all threads that a device has at once.
    uint64_t bytes() const { return stack_bytes_ + records_.bytes(); }

private:
    CUdeviceptr record(uint32_t program) const { return reinterpret_cast<CUdeviceptr>(records_.data() + program); }

    void set_stack(uint32_t levels) {
        OptixStackSizes most = {};
        for (const OptixProgramGroup program : programs_) {
            OptixStackSizes s = {};
            optix_.check(optixProgramGroupGetStackSize(program, &s, pipeline_), "its stack");
            most.cssRG = std::max(most.cssRG, s.cssRG), most.cssMS = std::max(most.cssMS, s.cssMS);
            most.cssCH = std::max(most.cssCH, s.cssCH);
            most.cssAH = std::max(most.cssAH, s.cssAH), most.cssIS = std::max(most.cssIS, s.cssIS);
        }
        // Rays are followed by ray generation alone (OptiX Programming Guide, "Stack size").
        const unsigned stack = most.cssRG + std::max({most.cssCH, most.cssMS, most.cssIS + most.cssAH});
        optix_.check(optixPipelineSetStackSize(pipeline_, 0, 0, stack, levels), "its stack");
        int device = 0, multiprocessors = 0, threads = 0;
        cuda_check(cudaGetDevice(&device), "device");
        cuda_check(cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device), "device");
        cuda_check(cudaDeviceGetAttribute(&threads, cudaDevAttrMaxThreadsPerMultiProcessor, device), "device");
        stack_bytes_ = uint64_t(multiprocessors) * uint64_t(threads) * stack;
    }
    void pack_records() {
        std::vector<Record> records(kPrograms);
        for (uint32_t i = 0; i < kPrograms; ++i)
            optix_.check(optixSbtRecordPackHeader(programs_[i], &records[i]), "its table of programs");
        records_ = DeviceBuffer<Record>(records, "OptiX's table of programs");
    }

    const OptixContext& optix_;
    OptixModule module_ = nullptr;
    OptixProgramGroup programs_[kPrograms] = {};
    OptixPipeline pipeline_ = nullptr;
    DeviceBuffer<Record> records_;
    uint64_t stack_bytes_ = 0;
};

}  // namespace

struct DeviceOptix::Parts {
    OptixContext optix;
    OptixStructure structure;
    Pipeline pipeline;
    OptixParams params;
    DeviceBuffer<OptixParams> on_device{1, "parameters of OptiX"};

    Parts(const Scene& scene, const SceneView& view, uint64_t room)
        : structure(build_optix_structure(optix, scene, view, room)), pipeline(optix, structure.two_levels),
          params{view, {}, structure.root, !scene.features.opacity} {}
};

DeviceOptix::DeviceOptix(const Scene& scene, const SceneView& on_device, uint64_t room) {
    const auto start = Clock::now();
    parts_ = std::make_unique<Parts>(scene, on_device, room);
    const OptixStructure& made = parts_->structure;
    facts_ = {made.bytes + parts_->pipeline.bytes() + parts_->on_device.bytes(), made.peak_bytes,
              made.predicted_peak_bytes, seconds_since(start)};
}
DeviceOptix::~DeviceOptix() = default;

void DeviceOptix::take(const HandedRays& handed, cudaStream_t stream) {
    parts_->params.handed = handed;
    DeviceMemory::put(parts_->on_device.data(), &parts_->params, sizeof(OptixParams));
    DeviceMemory::clear(handed.count, sizeof(uint32_t));
    for (const bool any_hit : {false, true}) trace(any_hit, stream);
    cuda_check(cudaStreamSynchronize(stream), "first launch of OptiX");
}

void DeviceOptix::trace(bool any_hit, cudaStream_t stream) const {
    parts_->pipeline.launch(any_hit ? kOccluded : kClosest, parts_->on_device, parts_->params.handed.capacity, stream);
}

}  // namespace ambilux
