/*
 * Loads the library of a co-simulation FMU and prints its outputs after each step. It serves machines without any other
 * tool, and emulated machines (wine, qemu-user).
 *
 *     host 2|3 LIBRARY TOKEN RESOURCES STEP COUNT OUTPUT...
 *
 * RESOURCES is a URI for FMI 2.0, a folder for FMI 3.0. OUTPUT is a letter and a value reference: r17 is a real number, i an
 * integer, b true or false.
 */
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#include <windows.h>
#else
#include <dlfcn.h>
#endif

#include "fmi2FunctionTypes.h"
#include "fmi3FunctionTypes.h"

enum { FIRST_OUTPUT = 7, MOST_OUTPUTS = 128 };

typedef void (*function)(void);

typedef struct {
    char kind;
    unsigned int reference;
} output;

static const char *library_path;

static function find(const char *name)
{
#if defined(_WIN32)
    static HMODULE library;
    library = library != NULL ? library : LoadLibraryA(library_path);
    const function found = library != NULL ? (function)GetProcAddress(library, name) : NULL;
#else
    static void *library;
    library = library != NULL ? library : dlopen(library_path, RTLD_NOW);
    function found = NULL;
    if (library != NULL) {
        *(void **)&found = dlsym(library, name); /* as POSIX says */
    }
#endif
    if (found == NULL) {
        fprintf(stderr, "%s: expected a library that has %s\n", library_path, name);
        exit(1);
    }
    return found;
}

static void expect(int status, const char *what)
{
    if (status != 0) {
        fprintf(stderr, "%s: expected status 0, got %d\n", what, status);
        exit(1);
    }
}

static void print_row(const double values[], size_t count)
{
    for (size_t i = 0; i < count; i++) {
        printf("%.17g%c", values[i], i + 1 < count ? ' ' : '\n');
    }
}

static void say2(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                 fmi2String message, ...)
{
    (void)environment;
    (void)category;
    va_list arguments;
    va_start(arguments, message);
    fprintf(stderr, "%s: status %d: ", name, (int)status);
    vfprintf(stderr, message, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

static void say3(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment;
    (void)category;
    fprintf(stderr, "status %d: %s\n", (int)status, message);
}

static void read2(fmi2Component instance, const output *wanted, double *value)
{
    int whole = 0;
    if (wanted->kind == 'i') {
        expect((int)((fmi2GetIntegerTYPE *)find("fmi2GetInteger"))(instance, &wanted->reference, 1, &whole),
               "fmi2GetInteger");
        *value = whole;
    } else if (wanted->kind == 'b') {
        expect((int)((fmi2GetBooleanTYPE *)find("fmi2GetBoolean"))(instance, &wanted->reference, 1, &whole),
               "fmi2GetBoolean");
        *value = whole != fmi2False ? 1.0 : 0.0;
    } else {
        expect((int)((fmi2GetRealTYPE *)find("fmi2GetReal"))(instance, &wanted->reference, 1, value), "fmi2GetReal");
    }
}

static void read3(fmi3Instance instance, const output *wanted, double *value)
{
    if (wanted->kind == 'i') {
        fmi3Int64 whole = 0;
        expect((int)((fmi3GetInt64TYPE *)find("fmi3GetInt64"))(instance, &wanted->reference, 1, &whole, 1), "fmi3GetInt64");
        *value = (double)whole;
    } else if (wanted->kind == 'b') {
        fmi3Boolean truth = false;
        expect((int)((fmi3GetBooleanTYPE *)find("fmi3GetBoolean"))(instance, &wanted->reference, 1, &truth, 1),
               "fmi3GetBoolean");
        *value = truth ? 1.0 : 0.0;
    } else {
        expect((int)((fmi3GetFloat64TYPE *)find("fmi3GetFloat64"))(instance, &wanted->reference, 1, value, 1),
               "fmi3GetFloat64");
    }
}

static void run2(char **given, double step, long steps, const output wanted[], size_t count)
{
    const fmi2CallbackFunctions callbacks = {say2, calloc, free, NULL, NULL};
    const fmi2Component instance = ((fmi2InstantiateTYPE *)find("fmi2Instantiate"))(
        "host", fmi2CoSimulation, given[3], given[4], &callbacks, fmi2False, fmi2False);
    expect(instance == NULL, "fmi2Instantiate");
    expect((int)((fmi2SetupExperimentTYPE *)find("fmi2SetupExperiment"))(instance, fmi2False, 0.0, 0.0, fmi2False, 0.0),
           "fmi2SetupExperiment");
    expect((int)((fmi2EnterInitializationModeTYPE *)find("fmi2EnterInitializationMode"))(instance),
           "fmi2EnterInitializationMode");
    expect((int)((fmi2ExitInitializationModeTYPE *)find("fmi2ExitInitializationMode"))(instance),
           "fmi2ExitInitializationMode");
    fmi2DoStepTYPE *do_step = (fmi2DoStepTYPE *)find("fmi2DoStep");
    for (long k = 0; k < steps; k++) {
        double values[MOST_OUTPUTS];
        expect((int)do_step(instance, (double)k * step, step, fmi2True), "fmi2DoStep");
        for (size_t i = 0; i < count; i++) {
            read2(instance, &wanted[i], &values[i]);
        }
        print_row(values, count);
    }
    expect((int)((fmi2TerminateTYPE *)find("fmi2Terminate"))(instance), "fmi2Terminate");
    ((fmi2FreeInstanceTYPE *)find("fmi2FreeInstance"))(instance);
}

static void run3(char **given, double step, long steps, const output wanted[], size_t count)
{
    const fmi3Instance instance = ((fmi3InstantiateCoSimulationTYPE *)find("fmi3InstantiateCoSimulation"))(
        "host", given[3], given[4], false, false, false, false, NULL, 0, NULL, say3, NULL);
    expect(instance == NULL, "fmi3InstantiateCoSimulation");
    expect((int)((fmi3EnterInitializationModeTYPE *)find("fmi3EnterInitializationMode"))(instance, false, 0.0, 0.0,
                                                                                         false, 0.0),
           "fmi3EnterInitializationMode");
    expect((int)((fmi3ExitInitializationModeTYPE *)find("fmi3ExitInitializationMode"))(instance),
           "fmi3ExitInitializationMode");
    fmi3DoStepTYPE *do_step = (fmi3DoStepTYPE *)find("fmi3DoStep");
    for (long k = 0; k < steps; k++) {
        double values[MOST_OUTPUTS], last;
        bool event, ends, early;
        expect((int)do_step(instance, (double)k * step, step, true, &event, &ends, &early, &last), "fmi3DoStep");
        for (size_t i = 0; i < count; i++) {
            read3(instance, &wanted[i], &values[i]);
        }
        print_row(values, count);
    }
    expect((int)((fmi3TerminateTYPE *)find("fmi3Terminate"))(instance), "fmi3Terminate");
    ((fmi3FreeInstanceTYPE *)find("fmi3FreeInstance"))(instance);
}

int main(int count, char **given)
{
    if (count <= FIRST_OUTPUT || count > FIRST_OUTPUT + MOST_OUTPUTS) {
        fprintf(stderr, "usage: host 2|3 LIBRARY TOKEN RESOURCES STEP COUNT OUTPUT...\n");
        return 2;
    }
    library_path = given[2];
    output wanted[MOST_OUTPUTS];
    const size_t outputs = (size_t)(count - FIRST_OUTPUT);
    for (size_t i = 0; i < outputs; i++) {
        wanted[i].kind = given[FIRST_OUTPUT + i][0];
        wanted[i].reference = wanted[i].kind != '\0' ? (unsigned int)strtoul(given[FIRST_OUTPUT + i] + 1, NULL, 10) : 0;
    }
    const double step = strtod(given[5], NULL);
    const long steps = strtol(given[6], NULL, 10);
    (strcmp(given[1], "2") == 0 ? run2 : run3)(given, step, steps, wanted, outputs);
    return 0;
}
