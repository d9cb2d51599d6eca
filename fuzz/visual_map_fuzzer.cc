#include "fuzz/readers.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  oriel::fuzz::visual_map({reinterpret_cast<const char*>(data), size});
  return 0;
}
