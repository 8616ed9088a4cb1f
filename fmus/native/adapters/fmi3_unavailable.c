/* The remaining functions of FMI 3.0: importers look them up, so each is exported and answers "not available". */
#include "fmi3Functions.h"

#include "instance.h"

#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* FMI says which parameters there are */
#endif

static fmi3Status unavailable(fmi3Instance instance, const char *function)
{
    if (instance != NULL) {
        vi_instance_fail(instance, function, "not available in this component");
    }
    return fmi3Error;
}

/* ---- types that no variable here has: every reference is refused, an empty request is fine ---- */

#define EMPTY_TYPE(NAME, CTYPE)                                                                                     \
    fmi3Status fmi3Get##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                      \
                             size_t nValueReferences, CTYPE values[], size_t nValues)                                \
    {                                                                                                                \
        return nValueReferences == 0 ? fmi3OK : unavailable(instance, "fmi3Get" #NAME);                              \
    }                                                                                                                \
    fmi3Status fmi3Set##NAME(fmi3Instance instance, const fmi3ValueReference valueReferences[],                      \
                             size_t nValueReferences, const CTYPE values[], size_t nValues)                          \
    {                                                                                                                \
        return nValueReferences == 0 ? fmi3OK : unavailable(instance, "fmi3Set" #NAME);                              \
    }

EMPTY_TYPE(Float32, fmi3Float32)
EMPTY_TYPE(Int8, fmi3Int8)
EMPTY_TYPE(UInt8, fmi3UInt8)
EMPTY_TYPE(Int16, fmi3Int16)
EMPTY_TYPE(UInt16, fmi3UInt16)
EMPTY_TYPE(Int32, fmi3Int32)
EMPTY_TYPE(UInt32, fmi3UInt32)
EMPTY_TYPE(UInt64, fmi3UInt64)
EMPTY_TYPE(String, fmi3String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    return nValueReferences == 0 ? fmi3OK : unavailable(instance, "fmi3GetBinary");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    return nValueReferences == 0 ? fmi3OK : unavailable(instance, "fmi3SetBinary");
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[])
{
    return nValueReferences == 0 ? fmi3OK : unavailable(instance, "fmi3SetClock");
}

/* ---- scheduled execution, clocks ---- */

#define UNAVAILABLE(NAME, ...)               \
    fmi3Status NAME(__VA_ARGS__)             \
    {                                        \
        return unavailable(instance, #NAME); \
    }

UNAVAILABLE(fmi3GetNumberOfVariableDependencies, fmi3Instance instance, fmi3ValueReference valueReference,
            size_t *nDependencies)
UNAVAILABLE(fmi3GetVariableDependencies, fmi3Instance instance, fmi3ValueReference dependent,
            size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
            size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[], size_t nDependencies)
UNAVAILABLE(fmi3GetIntervalDecimal, fmi3Instance instance, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
UNAVAILABLE(fmi3GetIntervalFraction, fmi3Instance instance, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
            fmi3IntervalQualifier qualifiers[])
UNAVAILABLE(fmi3GetShiftDecimal, fmi3Instance instance, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3Float64 shifts[])
UNAVAILABLE(fmi3GetShiftFraction, fmi3Instance instance, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
UNAVAILABLE(fmi3SetIntervalDecimal, fmi3Instance instance, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3Float64 intervals[])
UNAVAILABLE(fmi3SetIntervalFraction, fmi3Instance instance, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
UNAVAILABLE(fmi3SetShiftDecimal, fmi3Instance instance, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3Float64 shifts[])
UNAVAILABLE(fmi3SetShiftFraction, fmi3Instance instance, const fmi3ValueReference valueReferences[],
            size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
UNAVAILABLE(fmi3ActivateModelPartition, fmi3Instance instance, fmi3ValueReference clockReference,
            fmi3Float64 activationTime)
