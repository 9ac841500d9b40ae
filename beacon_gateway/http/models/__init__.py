"""The answers' bodies as values, one class for each schema of the OpenAPI document."""
