// The hand's filter for x86 machines with AVX2 and FMA; chosen when the program runs, not when it is built.
#define MPUCAL_EVALUATE_HAND evaluate_hand_avx2
#include "hand_impl.hpp"
