"""The published study of a WAM-V: its printed values as data, its trials simulated, its method carried out again."""
