// The filter for x86 machines with AVX2 and FMA; chosen when the program runs, not when it is built.
#define MPUCAL_EVALUATE evaluate_avx2
#include "filter_impl.hpp"
