#include "sim/solve/blas_info.h"

#include <dlfcn.h>

#include <cstdlib>
#include <memory>

extern "C" void dgemm_();

namespace rhytid {

namespace {

std::string resolved_path(const char* path) {
  const std::unique_ptr<char, decltype(&std::free)> real(realpath(path, nullptr), &std::free);
  return real ? real.get() : path;
}

/// The symbol as found in the object that answers dgemm_, not wherever else it may be loaded.
void* symbol_in(const std::string& library, const char* symbol) {
  void* handle = dlopen(library.c_str(), RTLD_LAZY | RTLD_NOLOAD);
  if (!handle) return nullptr;
  void* address = dlsym(handle, symbol);
  dlclose(handle);  // only drops the reference just taken
  return address;
}

}  // namespace

BlasInfo blas_info() {
  BlasInfo info{"", "unknown", ""};
  // Through the dynamic loader: the address of dgemm_ taken at compile time may be a local jump stub.
  void* dgemm = dlsym(RTLD_DEFAULT, "dgemm_");
  if (!dgemm) dgemm = reinterpret_cast<void*>(&dgemm_);
  Dl_info where{};
  if (!dladdr(dgemm, &where) || !where.dli_fname) return info;
  info.shared_object = resolved_path(where.dli_fname);
  if (void* config = symbol_in(where.dli_fname, "openblas_get_config")) {
    info.name = "openblas";
    info.config = reinterpret_cast<char* (*)()>(config)();
  } else if (symbol_in(where.dli_fname, "ATL_dgemm") ||
             info.shared_object.find("atlas") != std::string::npos) {
    info.name = "atlas";
  } else if (info.shared_object.find("/libblas") != std::string::npos ||
             info.shared_object.find("/blas/") != std::string::npos) {
    info.name = "reference";
  }
  return info;
}

}  // namespace rhytid
