// Graphs of an export in ONNX Runtime, by its C API: `LocalRun` for LocalWorld. One thread, on the CPU.
#pragma once

#include <onnxruntime_c_api.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "wayfarer/local.hpp"

class OnnxGraphs {
 public:
  /// Opens each graph when it is first run. Throws std::runtime_error.
  OnnxGraphs(std::string folder, std::vector<std::string> outputs)
      : folder_(std::move(folder)), outputs_(std::move(outputs)) {
    // the headers' version, or the newest that the library knows: both know what is used here
    const OrtApiBase* base = OrtGetApiBase();
    for (unsigned version = ORT_API_VERSION; !api_ && version >= 11; --version) api_ = base->GetApi(version);
    if (!api_) throw std::runtime_error("ONNX Runtime 1.11 or newer is needed");
    check(api_->CreateEnv(ORT_LOGGING_LEVEL_WARNING, "wayfarer", &environment_));
    check(api_->CreateSessionOptions(&options_));
    check(api_->SetIntraOpNumThreads(options_, 1));
    check(api_->CreateCpuMemoryInfo(OrtArenaAllocator, OrtMemTypeDefault, &memory_));
  }
  OnnxGraphs(const OnnxGraphs&) = delete;
  ~OnnxGraphs() {
    for (const auto& [gender, session] : sessions_) api_->ReleaseSession(session);
    api_->ReleaseMemoryInfo(memory_);
    api_->ReleaseSessionOptions(options_);
    api_->ReleaseEnv(environment_);
  }

  wayfarer::LocalTensors run(const std::string& gender, const wayfarer::LocalTensors& inputs) {
    std::vector<const char*> in, out;
    std::vector<OrtValue*> values, found(outputs_.size(), nullptr);
    for (const auto& [name, tensor] : inputs) {
      OrtValue* value = nullptr;
      check(api_->CreateTensorWithDataAsOrtValue(
          memory_, const_cast<float*>(tensor.values.data()), tensor.values.size() * sizeof(float), tensor.shape.data(),
          tensor.shape.size(), ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &value));
      in.push_back(name.c_str());
      values.push_back(value);
    }
    for (const std::string& name : outputs_) out.push_back(name.c_str());
    OrtStatus* status = api_->Run(session(gender), nullptr, in.data(), values.data(), in.size(), out.data(),
                                  out.size(), found.data());
    for (OrtValue* value : values) api_->ReleaseValue(value);
    check(status);
    wayfarer::LocalTensors results;
    for (std::size_t k = 0; k < found.size(); ++k) {
      OrtTensorTypeAndShapeInfo* info = nullptr;
      std::size_t count = 0;
      void* data = nullptr;
      check(api_->GetTensorTypeAndShape(found[k], &info));
      check(api_->GetTensorShapeElementCount(info, &count));
      api_->ReleaseTensorTypeAndShapeInfo(info);
      check(api_->GetTensorMutableData(found[k], &data));
      const auto* first = static_cast<const float*>(data);
      results[outputs_[k]].values.assign(first, first + count);
      api_->ReleaseValue(found[k]);
    }
    return results;
  }

 private:
  void check(OrtStatus* status) const {
    if (!status) return;
    const std::string message = api_->GetErrorMessage(status);
    api_->ReleaseStatus(status);
    throw std::runtime_error("onnxruntime: " + message);
  }

  OrtSession* session(const std::string& gender) {
    OrtSession*& session = sessions_[gender];
    if (!session)
      check(api_->CreateSession(environment_, (folder_ + "/step_" + gender + ".onnx").c_str(), options_, &session));
    return session;
  }

  std::string folder_;
  std::vector<std::string> outputs_;
  const OrtApi* api_ = nullptr;
  OrtEnv* environment_ = nullptr;
  OrtSessionOptions* options_ = nullptr;
  OrtMemoryInfo* memory_ = nullptr;
  std::map<std::string, OrtSession*> sessions_;
};
