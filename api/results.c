#include "results.h"

#include <math.h>

void api_results_open(struct results *results, struct arena *arena, size_t width, bool flat,
                      int digits)
{
    *results = (struct results){api_text(arena), width, flat, digits, 0};
    api_text_put(&results->text, "[");
}

bool api_results_add(struct results *results, double *const columns[], size_t n)
{
    struct text *text = &results->text;
    bool nested = results->width > 1 && !results->flat;
    for (size_t i = 0; i < n; i++) {
        if (results->count) api_text_put(text, ",");
        if (nested) api_text_put(text, "[");
        for (size_t k = 0; k < results->width; k++) {
            if (!isfinite(columns[k][i])) return false;
            if (k) api_text_put(text, ",");
            api_text_number(text, columns[k][i], results->digits);
        }
        if (nested) api_text_put(text, "]");
        results->count++;
    }
    return true;
}

void api_results_close(struct results *results)
{
    api_text_put(&results->text, "]");
}
